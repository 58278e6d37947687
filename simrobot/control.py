"""Control socket of a running robot: requests and responses are JSON objects, one per line.

A request holds the fields of `Behaviour` to change; {} only reads. The response is {"behaviour": {...},
"base": {...}} or {"error": "..."}; "base" is what the base has heard of its last motion, null before the
first and without a base. Only the same user can connect: the mode of the Unix socket is 0600.
"""

import asyncio
import json
import os
import socket
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from common.errors import ExitCode, UserError
from common.private_files import make_own_directory

_LONGEST_LINE = 64 * 1024
_TIMEOUT_S = 5.0

Change = Callable[[dict[str, Any]], dict[str, Any]]
"""Applies the given fields and returns the resulting behaviour; raises UserError."""
BaseFacts = Callable[[], Mapping[str, Any] | None]
"""Returns what the base has heard of its last motion (simrobot.base.Heard)."""


def default_path() -> Path:
    """Returns the default path of the socket, one per user and ROS domain; its directory is this user's own.

    Raises:
        UserError: another user has made a directory or link of that name first, or it can't be made.
    """
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        directory = Path(session) / "simrobot"
    else:
        directory = Path(tempfile.gettempdir()) / f"simrobot-{os.getuid()}"
    try:
        make_own_directory(directory)
    except OSError as error:
        raise UserError(
            f"{directory} can't be used: {error.strerror}", "Name another socket with --control"
        ) from error
    return directory / f"{os.environ.get('ROS_DOMAIN_ID') or '0'}.sock"


@asynccontextmanager
async def listening(path: Path, change: Change, base: BaseFacts = lambda: None) -> AsyncIterator[None]:
    """Serves requests until the block ends.

    Raises:
        UserError: another robot serves at this path, or it can't be used.
    """
    _remove_stale(path)
    try:
        mask = os.umask(0o177)
        try:
            server = await asyncio.start_unix_server(
                lambda reader, writer: _serve(reader, writer, change, base), path, limit=_LONGEST_LINE
            )
        finally:
            os.umask(mask)
    except OSError as error:
        raise UserError(
            f"control socket {path} can't be created: {error}", "Choose another with --control"
        ) from error
    try:
        yield
    finally:
        server.close()
        _remove(path)


def ask(path: Path, fields: dict[str, Any]) -> dict[str, Any]:
    """Sends one request and returns the resulting behaviour.

    Raises:
        UserError: no robot responds (exit code 3), or it refuses.
    """
    behaviour: dict[str, Any] = _answered(path, fields)["behaviour"]
    return behaviour


def ask_base(path: Path) -> dict[str, Any] | None:
    """Returns what the base has heard of its last motion; None before the first, and without a base.

    Raises:
        UserError: no robot responds (exit code 3).
    """
    heard: dict[str, Any] | None = _answered(path, {}).get("base")
    return heard


def _answered(path: Path, fields: dict[str, Any]) -> dict[str, Any]:
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(_TIMEOUT_S)
            connection.connect(str(path))
            connection.sendall(json.dumps(fields).encode() + b"\n")
            with connection.makefile("rb") as lines:
                answer: dict[str, Any] = json.loads(lines.readline())
    except (OSError, ValueError) as error:
        raise UserError(
            f"no simulated robot answers at {path}: {error}",
            "Start one with: simrobot run; or give its socket with --control",
            exit_code=ExitCode.UNREACHABLE,
        ) from error
    if "error" in answer:
        raise UserError(answer["error"], exit_code=ExitCode.USAGE)
    return answer


def _remove_stale(path: Path) -> None:
    """Removes the stale socket of a robot that was killed."""
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            _remove(path)
            return
        except OSError as error:
            raise UserError(f"control socket {path} can't be used: {error}") from error
    raise UserError(f"another simulated robot listens at {path}", "Stop it, or choose another with --control")


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)


async def _serve(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, change: Change, base: BaseFacts
) -> None:
    try:
        while line := await reader.readline():
            writer.write(json.dumps(_answer(line, change, base)).encode() + b"\n")
            await writer.drain()
    except (ConnectionError, ValueError):
        pass  # The client has gone, or sent a line beyond the limit: only this connection ends.
    finally:
        writer.close()


def _answer(line: bytes, change: Change, base: BaseFacts) -> dict[str, Any]:
    try:
        fields = json.loads(line)
        if not isinstance(fields, dict):
            return {"error": "a request is a JSON object"}
        return {"behaviour": change(fields), "base": base()}
    except ValueError as error:
        return {"error": f"a request is one line of JSON: {error}"}
    except UserError as error:
        return {"error": str(error)}
