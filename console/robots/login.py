"""What a robot's keeper hands over, read and kept: `robot-gateway credentials add` prints it.

# Robot Gateway login 1
robot: lab2
name: anna
role: operator
token: ...
authority:
-----BEGIN CERTIFICATE-----
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from common.private_files import write_private
from console.client import Credentials
from console.robots.book import Robot, RobotBook, book_path
from console.robots.credentials import credentials_directory
from console.robots.edit import put_robot

_HEAD: Final = "# Robot Gateway login 1"
_WORDS: Final = ("robot", "name", "role", "token")
_PARTS: Final = ("authority", "certificate", "key")
_LARGEST: Final = 64 * 1024


@dataclass(frozen=True, slots=True)
class Login:
    """One person's way in to one robot.

    Args:
        name: of the person, as the robot's keeper calls them.
        role: what they may do.
        credentials: what they show.
    """

    name: str
    role: str
    credentials: Credentials = field(repr=False)


def parse_login(text: str) -> Login:
    """The login that a text is.

    Raises:
        UserError: it is none, or a part is missing. The line quotes nothing of it.
    """
    lines = text[:_LARGEST].splitlines()
    if not lines or lines[0].strip() != _HEAD:
        raise _no_login("it does not begin as one")
    words: dict[str, str] = {}
    parts: dict[str, list[str]] = {}
    part: list[str] | None = None
    for line in lines[1:]:
        key, colon, value = line.partition(":")
        if colon and key in _WORDS:
            words[key], part = value.strip(), None
        elif colon and key in _PARTS and not value.strip():
            part = parts[key] = []
        elif part is not None:
            part.append(line)
    if "authority" not in parts:
        raise _no_login("the robot's certificate authority is not in it")
    if ("certificate" in parts) != ("key" in parts):
        raise _no_login("a certificate and its key belong together")
    if not (words.get("token") or "key" in parts):
        raise _no_login("neither a token nor a key is in it")
    pems = {key: ("\n".join(those) + "\n").encode() for key, those in parts.items()}
    shown = Credentials(
        ca_certificate=pems["authority"],
        client_certificate=pems.get("certificate"),
        client_key=pems.get("key"),
        token=words.get("token") or None,
    )
    return Login(words.get("name", ""), words.get("role", ""), shown)


def keep_login(name: str, target: str, shown: Credentials, path: Path | None = None) -> RobotBook:
    """Writes the files, each its owner's alone, and the robot's entry that names them.

    Args:
        name: what people call the robot.
        target: HOST:PORT of its gateway.
        shown: what proves who asks. What is None is forgotten.
        path: another file than this person's own.

    Raises:
        UserError: the name or the address won't do, or something can't be written.
    """
    path = path or book_path()
    # First without any file: whatever is wrong with name or address is known before a secret is written.
    put_robot(name, Robot(target=target), path=path)
    directory = credentials_directory(path, name)
    files = {
        "ca_certificate_file": (directory / "ca.pem", shown.ca_certificate),
        "client_certificate_file": (directory / "client.pem", shown.client_certificate),
        "client_key_file": (directory / "client-key.pem", shown.client_key),
        "token_file": (directory / "token", shown.token.encode() if shown.token else None),
    }
    kept: dict[str, Path] = {}
    for key, (file, content) in files.items():
        if content is None:
            file.unlink(missing_ok=True)
        else:
            write_private(file, content)
            kept[key] = file
    return put_robot(name, Robot(target=target, **kept), path=path)


def _no_login(why: str) -> UserError:
    return UserError(
        f"this is no login: {why}",
        "On the robot: robot-gateway credentials add NAME --role ROLE prints one",
        exit_code=ExitCode.USAGE,
    )
