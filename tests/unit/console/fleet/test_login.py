"""Storing the login for a fleet, and reading it again."""

from pathlib import Path

import pytest

from common.errors import UserError
from console.fleet.login import HEAD, FleetLogin, keep_fleet_login, login_of_servers, read_fleet_login

LOGIN = f"""{HEAD}
fleet: lab
name: anna\x1b]0;owned\x07
servers: tls://hub1:4222, tls://[fe80::1]:4222
receivers: {"0f" * 32}, {"1e" * 32}
credentials:
SECRET
authority:
CA
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robotctl" / "fleet.toml"


def test_it_is_read_as_it_was_stored(path: Path) -> None:
    stored = keep_fleet_login(LOGIN, path)
    assert read_fleet_login(path) == stored
    assert (stored.fleet, stored.servers) == ("lab", ("tls://hub1:4222", "tls://[fe80::1]:4222"))
    assert stored.name.isprintable()
    assert stored.receivers == (b"\x0f" * 32, b"\x1e" * 32)
    files = (stored.credentials_file, stored.ca_file)
    assert [file.read_text() for file in files if file] == ["SECRET\n", "CA\n"]
    assert {file.stat().st_mode & 0o777 for file in (*files, path) if file} == {0o600}


@pytest.mark.parametrize(
    ("found", "instead", "said"),
    [
        (HEAD, "# Robot Gateway login 1", "does not begin"),
        ("fleet: lab", "fleet: Lab/..", "no name of a fleet"),
        ("fleet: lab", "", "no name of a fleet"),
        ("tls://hub1:4222, tls://[fe80::1]:4222", "", "1 to 16 addresses"),
        ("tls://hub1:4222", "http://hub1", "is not an address"),
        ("credentials:\nSECRET\n", "", "credentials are missing"),
        ("authority:\nCA\n", "", "authority is missing"),
        ("0f" * 32, "0F" * 32, "64 hexadecimal digits"),
    ],
)
def test_what_is_none_is_not_stored_and_not_quoted(path: Path, found: str, instead: str, said: str) -> None:
    with pytest.raises(UserError, match=said) as error:
        keep_fleet_login(LOGIN.replace(found, instead), path)
    assert "SECRET" not in str(error.value)
    assert not path.exists()


def test_without_one_it_says_what_to_type(path: Path) -> None:
    with pytest.raises(UserError, match="robotctl fleet login FILE"):
        read_fleet_login(path)


@pytest.mark.parametrize("text", ["servers = [", "fleet = 'lab'\nservers = 'x'", "fleet = 3\n"])
def test_a_damaged_file_is_one_line(path: Path, text: str) -> None:
    keep_fleet_login(LOGIN, path)
    path.write_text(text)
    with pytest.raises(UserError, match="login FILE --replace"):
        read_fleet_login(path)


def test_a_secret_that_others_may_read_is_refused(path: Path) -> None:
    stored = keep_fleet_login(LOGIN, path)
    assert stored.credentials_file
    stored.credentials_file.chmod(0o644)
    with pytest.raises(UserError, match="chmod 600"):
        read_fleet_login(path)


def test_a_hub_without_authentication() -> None:
    servers = ("nats://127.0.0.1:1", "nats://localhost:2")
    assert login_of_servers("nats://127.0.0.1:1, nats://localhost:2") == FleetLogin("", "", servers)
    with pytest.raises(UserError, match="is not an address"):
        login_of_servers("a:1")


@pytest.mark.parametrize("server", ["nats://hub.example:4222", "tls://127.0.0.1:4222", "nats://10.0.0.1:1"])
def test_another_computer_is_not_reached_without_tls(server: str) -> None:
    with pytest.raises(UserError, match="fleet login FILE"):
        login_of_servers(f"nats://127.0.0.1:4222, {server}")
