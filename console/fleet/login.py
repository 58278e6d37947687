"""The operator's login for a fleet: where its hub is, as whom to connect, and whose receipts count.

# Robot Gateway fleet login 1
fleet: lab
name: anna
servers: tls://hub1:4222, tls://hub2:4222
receivers: 5d41... (Ed25519 public keys in hex, separated by commas)
credentials:
-----BEGIN NATS USER JWT-----
...
authority:
-----BEGIN CERTIFICATE-----
...

Stored beside the file of known robots: fleet.toml with the values, and a folder `fleet` with the secrets.
"""

import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from common.errors import ExitCode, UserError
from common.printable import printable
from common.private_files import write_all_private
from console.robots.credentials import read_private
from console.robots.login_text import parse_login_text
from console.robots.robots_file import read_text, robots_file_path
from fleet.names import ROBOT_NAME
from fleet.servers import exposed_server

HEAD: Final = "# Robot Gateway fleet login 1"
_WORDS: Final = ("fleet", "name", "servers", "receivers")
_BLOCKS: Final = ("credentials", "authority")
_FILES: Final = {"credentials": "user.creds", "authority": "ca.pem"}
_SERVER: Final = re.compile(r"(?:tls|nats)://[A-Za-z0-9.:_\[\]-]{1,255}")
_KEY: Final = re.compile(r"[0-9a-f]{64}")
_MOST_SERVERS: Final = 16


@dataclass(frozen=True, slots=True)
class FleetLogin:
    """How to reach the hub of a fleet.

    Args:
        fleet: Its name.
        name: The operator, as the hub knows them.
        servers: Of the hub, as "tls://host:4222".
        receivers: Ed25519 public keys of the fleet's receivers, 32 bytes each.
        credentials_file: The operator's NATS credentials; None connects without.
        ca_file: Certificate of the authority of the servers' certificates (PEM); None connects without TLS.
    """

    fleet: str
    name: str
    servers: tuple[str, ...]
    receivers: tuple[bytes, ...] = ()
    credentials_file: Path | None = None
    ca_file: Path | None = None


def fleet_login_path() -> Path:
    """Returns the file of the stored login: fleet.toml beside the file of known robots."""
    return robots_file_path().with_name("fleet.toml")


def keep_fleet_login(text: str, path: Path | None = None) -> FleetLogin:
    """Stores the login that a text contains, each file readable by its owner only, and returns it.

    Raises:
        UserError: It is none, or a file can't be written. Nothing of it is quoted.
    """
    path = path or fleet_login_path()
    found = parse_login_text(text, HEAD, _WORDS, _BLOCKS)
    if found is None:
        raise _not_a_login("it does not begin as one")
    for key in ("credentials", "authority"):
        if not found.blocks.get(key, "").strip():
            raise _not_a_login(f"its {key} are missing" if key == "credentials" else f"its {key} is missing")
    values = {
        "fleet": found.words.get("fleet", ""),
        "name": printable(found.words.get("name", "")),
        "servers": _listed(found.words.get("servers", "")),
        "receivers": _listed(found.words.get("receivers", "")),
    }
    login = _login(path, values, _not_a_login)
    document = "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items())
    folder = path.parent / "fleet"
    # The file that names them comes last: an interruption leaves no login without its secrets.
    files = {folder / name: found.blocks[key].encode() for key, name in _FILES.items()}
    write_all_private({**files, path: document.encode()})
    return login


def read_fleet_login(path: Path | None = None) -> FleetLogin:
    """Returns the stored login.

    Raises:
        UserError: There is none, it is wrong, or others may read its secret.
    """
    path = path or fleet_login_path()
    text = read_text(path)
    if not text:
        raise UserError(
            "there is no login for a fleet",
            "Type: robotctl fleet login FILE, with the file that the hub's administrator made by "
            "'robot-bridge hub operator NAME'",
            exit_code=ExitCode.USAGE,
        )
    try:
        values = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise _wrong_file(path, f"not TOML: {error}") from error
    login = _login(path, values, lambda why: _wrong_file(path, why))
    if login.credentials_file:
        read_private(login.credentials_file, "credentials file")
    return login


def login_of_servers(servers: str) -> FleetLogin:
    """Returns the login of a hub without authentication and TLS, on this computer: a demonstration.

    Args:
        servers: Separated by commas.

    Raises:
        UserError: One is no server, or on another computer.
    """

    def wrong(why: str) -> UserError:
        return UserError(
            f"--hub: {why}", "Write nats://127.0.0.1:4222, for example", exit_code=ExitCode.USAGE
        )

    named = _servers(_listed(servers), wrong)
    if server := exposed_server(named, None):
        raise UserError(
            f"--hub: {server} is not on this computer, and the connection would not be encrypted",
            "Log in with the file that the hub's administrator made: robotctl fleet login FILE",
            exit_code=ExitCode.USAGE,
        )
    return FleetLogin("", "", named)


def _login(path: Path, values: dict[str, Any], wrong: Any) -> FleetLogin:
    fleet, receivers = values.get("fleet"), values.get("receivers", [])
    if not isinstance(fleet, str) or not ROBOT_NAME.fullmatch(fleet):
        raise wrong("'fleet' is no name of a fleet")
    if not isinstance(receivers, list) or not all(_KEY.fullmatch(str(key)) for key in receivers):
        raise wrong("'receivers' are not public keys of 64 hexadecimal digits")
    folder = path.parent / "fleet"
    return FleetLogin(
        fleet,
        printable(str(values.get("name", ""))),
        _servers(values.get("servers"), wrong),
        tuple(bytes.fromhex(str(key)) for key in receivers),
        folder / _FILES["credentials"],
        folder / _FILES["authority"],
    )


def _servers(servers: Any, wrong: Any) -> tuple[str, ...]:
    if not isinstance(servers, list) or not 0 < len(servers) <= _MOST_SERVERS:
        raise wrong(f"'servers' are not 1 to {_MOST_SERVERS} addresses")
    for server in servers:
        if not isinstance(server, str) or not _SERVER.fullmatch(server):
            raise wrong("a server is not an address such as tls://hub.example:4222")
    return tuple(servers)


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _not_a_login(why: str) -> UserError:
    return UserError(
        f"this is not a login for a fleet: {why}",
        "At the hub, 'robot-bridge hub operator NAME' prints one",
        exit_code=ExitCode.USAGE,
    )


def _wrong_file(path: Path, why: str) -> UserError:
    return UserError(
        f"{path}: {why}",
        "Store the login again: robotctl fleet login FILE --replace",
        exit_code=ExitCode.USAGE,
    )
