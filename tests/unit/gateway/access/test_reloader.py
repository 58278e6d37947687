"""Reloading: changes take effect, and files that can't be read leave the last good version in effect."""

import asyncio
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import CredentialReloader, LoadedAccess, TlsFiles, load_access
from gateway.access.role import Role


@pytest.fixture
def directory(tmp_path: Path) -> CredentialDirectory:
    directory = CredentialDirectory(tmp_path / "credentials")
    CredentialAdmin(directory, "lab").initialize(("localhost",))
    return directory


def tls_of(directory: CredentialDirectory) -> TlsFiles:
    return TlsFiles(directory.server.certificate, directory.server.key, directory.ca.certificate)


async def test_a_new_credential_is_loaded_at_once_and_reported_once(directory: CredentialDirectory) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, None, changes.append)
    credential, _ = CredentialAdmin(directory, "lab").add(CredentialRequest("anna", Role.VIEWER))
    await asyncio.gather(*(reloader.reload_for_unknown() for _ in range(20)))
    await reloader.reload_for_unknown()
    assert [set(each.store.credentials) for each in changes] == [{credential.credential_id}]
    assert reloader.loaded is changes[0]


async def test_a_damaged_file_changes_nothing_and_is_reported_after_three_polls(
    directory: CredentialDirectory,
) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    before, text = reloader.loaded, directory.store_file.read_text()
    directory.store_file.write_text("damaged")
    problems = []
    for _ in range(3):
        await reloader.reload_for_unknown()
        problems.append(reloader.view().credentials_error)
    assert problems[:2] == ["", ""]
    assert "is damaged" in problems[2]
    directory.store_file.write_text(text)
    await reloader.reload_for_unknown()
    assert reloader.view().credentials_error == ""
    assert (reloader.loaded, changes) == (before, [])


def test_the_end_of_each_certificate_is_loaded(directory: CredentialDirectory) -> None:
    loaded = load_access(directory, tls_of(directory))
    assert set(loaded.ends_s) == {"server_certificate", "authority"}
    assert loaded.ends_s["server_certificate"] < loaded.ends_s["authority"]


def test_a_key_of_another_certificate_is_refused(directory: CredentialDirectory) -> None:
    tls = TlsFiles(directory.server.certificate, directory.ca.key)
    with pytest.raises(UserError, match="is not the key of"):
        load_access(directory, tls)
