"""A login: one user's credentials for one robot, as `robot-gateway credentials add` prints them.

# Robot Gateway login 1
robot: lab2
name: anna
role: operator
token: ...
authority:
-----BEGIN CERTIFICATE-----
"""

import re
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from common.printable import printable
from console.credentials import Credentials
from console.robots.credentials import credentials_directory
from console.robots.login_text import parse_login_text
from console.robots.robots_file import Robot, RobotsFile, robots_file_path
from console.robots.robots_file_edit import put_robot

_HEAD: Final = "# Robot Gateway login 1"
_WORDS: Final = ("robot", "name", "role", "token")
_TOKEN: Final = re.compile(r"rgt-([0-9a-f]{12})\.")
_PARTS: Final = ("authority", "certificate", "key")


@dataclass(frozen=True, slots=True)
class Login:
    """The content of a login.

    Args:
        name: The user, as the robot knows them.
        role: Their role: viewer, operator or admin.
        credentials: Token or client certificate, and the robot's certificate authority.
    """

    name: str
    role: str
    credentials: Credentials = field(repr=False)

    @property
    def revoked_by(self) -> str:
        """What revokes this login alone: the ID in its token; without a token the user's name."""
        token = _TOKEN.match(self.credentials.token or "")
        return token[1] if token else self.name


def parse_login(text: str) -> Login:
    """Returns the login that a text contains.

    Raises:
        UserError: It is not a login, or a part is missing. The line quotes nothing of it.
    """
    found = parse_login_text(text, _HEAD, _WORDS, _PARTS)
    if found is None:
        raise _not_a_login("it does not begin as one")
    words, parts = found.words, found.blocks
    if "authority" not in parts:
        raise _not_a_login("the robot's certificate authority is not in it")
    if ("certificate" in parts) != ("key" in parts):
        raise _not_a_login("a certificate and its key belong together")
    if not (words.get("token") or "key" in parts):
        raise _not_a_login("neither a token nor a key is in it")
    pems = {key: block.encode() for key, block in parts.items()}
    shown = Credentials(
        ca_certificate=pems["authority"],
        client_certificate=pems.get("certificate"),
        client_key=pems.get("key"),
        token=words.get("token") or None,
    )
    return Login(printable(words.get("name", "")), printable(words.get("role", "")), shown)


def keep_login(name: str, target: str, credentials: Credentials, path: Path | None = None) -> RobotsFile:
    """Writes the credentials, each file readable by its owner only, and the robot's entry that names them.

    Interrupted at any point it leaves the login that was stored before or the new one, whole: each login has
    files of its own, and those of another one are deleted only when the entry names them no more.

    Args:
        name: The robot's name.
        target: HOST:PORT of its gateway.
        credentials: To be stored.
        path: Another file than this user's own.

    Raises:
        UserError: The name or the address is not allowed, or a file can't be written.
        OSError: A file of the login before can't be deleted.
    """
    path = path or robots_file_path()
    directory = credentials_directory(path, name)
    mark = secrets.token_hex(4)
    contents = {
        "ca_certificate_file": (f"ca-{mark}.pem", credentials.ca_certificate),
        "client_certificate_file": (f"client-{mark}.pem", credentials.client_certificate),
        "client_key_file": (f"client-key-{mark}.pem", credentials.client_key),
        "token_file": (f"token-{mark}", credentials.token.encode() if credentials.token else None),
    }
    stored = {key: (directory / file, content) for key, (file, content) in contents.items() if content}
    robot = Robot(target=target, **{key: file for key, (file, _) in stored.items()})
    return put_robot(name, robot, path=path, contents=dict(stored.values()))


def _not_a_login(why: str) -> UserError:
    return UserError(
        f"this is not a login: {why}",
        "On the robot: robot-gateway credentials add NAME --role ROLE prints one",
        exit_code=ExitCode.USAGE,
    )
