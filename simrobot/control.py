"""Changes a running robot's behaviour: one JSON object per line over a Unix socket, one per line back.

A request holds the fields of `Behaviour` that shall change ({} only asks). The answer is {"behaviour": {...}}
or {"error": "..."}. Only this user can connect: the socket's mode is 0600.
"""

import asyncio
import json
import os
import socket
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from common.errors import ExitCode, UserError

_LONGEST_LINE = 64 * 1024
_ANSWER_WITHIN_S = 5.0

Change = Callable[[dict[str, Any]], dict[str, Any]]
"""Takes the wish, gives the behaviour in force; raises UserError."""


def default_path() -> Path:
    """Where a robot of this user listens: one place per ROS domain, so that robots do not meet."""
    base = os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()
    return Path(base) / f"simrobot-{os.getuid()}-{os.environ.get('ROS_DOMAIN_ID') or '0'}.sock"


@asynccontextmanager
async def listening(path: Path, change: Change) -> AsyncIterator[None]:
    """Serves requests until the block ends.

    Raises:
        UserError: another robot listens there, or the path can't be used.
    """
    _make_way(path)
    try:
        mask = os.umask(0o177)
        try:
            server = await asyncio.start_unix_server(
                lambda reader, writer: _converse(reader, writer, change), path, limit=_LONGEST_LINE
            )
        finally:
            os.umask(mask)
    except OSError as error:
        raise UserError(
            f"control socket {path} can't be made: {error}", "Choose another with --control"
        ) from error
    try:
        yield
    finally:
        server.close()
        _remove(path)


def ask(path: Path, wish: dict[str, Any]) -> dict[str, Any]:
    """Sends one request and gives the behaviour that is then in force.

    Raises:
        UserError: nobody listens (exit code 3), or the robot refuses.
    """
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(_ANSWER_WITHIN_S)
            connection.connect(str(path))
            connection.sendall(json.dumps(wish).encode() + b"\n")
            with connection.makefile("rb") as lines:
                answer = json.loads(lines.readline())
    except (OSError, ValueError) as error:
        raise UserError(
            f"no simulated robot answers at {path}: {error}",
            "Start one with: simrobot run; or name its socket with --control",
            exit_code=ExitCode.UNREACHABLE,
        ) from error
    if "error" in answer:
        raise UserError(answer["error"], exit_code=ExitCode.USAGE)
    behaviour: dict[str, Any] = answer["behaviour"]
    return behaviour


def _make_way(path: Path) -> None:
    """Removes the socket of a robot that was killed; one that still answers stays."""
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
    raise UserError(f"another simulated robot listens at {path}", "End it, or choose another with --control")


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)


async def _converse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, change: Change) -> None:
    try:
        while line := await reader.readline():
            writer.write(json.dumps(_answer(line, change)).encode() + b"\n")
            await writer.drain()
    except (ConnectionError, ValueError):
        pass  # gone, or a line beyond the limit: this conversation ends, the robot goes on
    finally:
        writer.close()


def _answer(line: bytes, change: Change) -> dict[str, Any]:
    try:
        wish = json.loads(line)
        if not isinstance(wish, dict):
            return {"error": "a request is a JSON object"}
        return {"behaviour": change(wish)}
    except ValueError as error:
        return {"error": f"a request is one line of JSON: {error}"}
    except UserError as error:
        return {"error": str(error)}
