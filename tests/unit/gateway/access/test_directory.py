"""Errors of files that can't be read suggest `init` only where nothing would be replaced."""

import os
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.access.credential_admin import CredentialAdmin
from gateway.access.directory import CredentialDirectory, KeyPairFiles
from gateway.access.store import Store
from tests.support.file_owner import files_belong_to


def test_where_there_is_nothing_the_line_says_how_to_begin(tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        CredentialDirectory(tmp_path).read_store()
    assert caught.value.remedy == f"Type: robot-gateway credentials init --directory {tmp_path}"


def test_in_a_container_it_is_the_command_that_works_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOT_GATEWAY_CREDENTIALS", "docker compose run --rm -T credentials")
    with pytest.raises(UserError) as caught:
        CredentialDirectory(tmp_path).ca.read()
    assert caught.value.remedy == "Type: docker compose run --rm -T credentials init"


def test_a_file_of_another_user_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = CredentialDirectory(tmp_path)
    CredentialAdmin(files, "lab").initialize(("localhost",))
    assert files.read_store() == Store()
    files_belong_to(os.geteuid() + 1, monkeypatch)
    for read in (files.read_store, files.server.read, files.ca.read):
        with pytest.raises(UserError, match="belongs to another user") as seen:
            read()
        assert seen.value.remedy.startswith("Type: chown ")


def test_what_another_user_has_made_is_not_to_be_made_anew(tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        KeyPairFiles(tmp_path / "bought.pem", tmp_path / "bought-key.pem", "server certificate").read()
    assert "No such file" in caught.value.what
    assert "credentials init" not in caught.value.remedy


def test_what_is_there_and_can_not_be_read_is_not_to_be_made_anew(tmp_path: Path) -> None:
    directory = CredentialDirectory(tmp_path)
    directory.store_file.mkdir()
    with pytest.raises(UserError, match="Is a directory") as caught:
        directory.read_store()
    assert "permissions" in caught.value.remedy


@pytest.mark.parametrize(
    ("pair", "remedy"),
    [
        (
            "server",
            "Restore copies of both, or replace both (HOST: a name by which laptops reach this robot): "
            "robot-gateway credentials rotate server --host HOST --directory {path}",
        ),
        (
            "ca",
            "Restore copies of both, or make a new authority, whose certificate every laptop then needs: "
            "robot-gateway credentials rotate ca --directory {path}",
        ),
    ],
)
def test_a_damaged_pair_is_to_be_restored_or_replaced(tmp_path: Path, pair: str, remedy: str) -> None:
    directory = CredentialDirectory(tmp_path)
    CredentialAdmin(directory, "lab").initialize(("localhost",))
    files: KeyPairFiles = getattr(directory, pair)
    files.certificate.write_text("damaged")
    with pytest.raises(UserError, match="can't be parsed") as caught:
        files.read()
    assert caught.value.remedy == remedy.format(path=tmp_path)


def test_a_damaged_pair_of_another_authority_is_not_to_be_made_anew(tmp_path: Path) -> None:
    for name in ("bought.pem", "bought-key.pem"):
        (tmp_path / name).write_text("damaged")
        (tmp_path / name).chmod(0o600)
    with pytest.raises(UserError, match="can't be parsed") as caught:
        KeyPairFiles(tmp_path / "bought.pem", tmp_path / "bought-key.pem", "server certificate").read()
    assert caught.value.remedy == "Replace them by PEM files, the key without a passphrase"
