"""Asks a running camera tap for its state."""

import socket
from pathlib import Path
from typing import Any, Final

from common.camera_tap import (
    STATUS_REQUEST,
    Kind,
    MalformedPacketError,
    decode,
    decode_object,
)
from common.errors import ExitCode, UserError
from common.start_command import start_command

_DEADLINE_S: Final = 3.0
MAX_STATE_BYTES: Final = 128 * 1024
"""Room for the counts of all topics that are counted separately, with names of the greatest length."""


def observed_state(path: Path) -> dict[str, Any]:
    """Returns the state of the tap.

    Args:
        path: of its socket.

    Raises:
        UserError: it does not respond.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.settimeout(_DEADLINE_S)
        try:
            connection.connect(str(path))
            connection.send(STATUS_REQUEST)
            return _state_in(connection.recv(MAX_STATE_BYTES))
        except TimeoutError as error:
            raise _silent(path, "it does not respond") from error
        except MalformedPacketError as error:
            raise _silent(path, f"it sent {error}") from error
        except OSError as error:
            raise _silent(path, error.strerror or type(error).__name__) from error


def _state_in(packet: bytes) -> dict[str, Any]:
    header, content = decode(packet)
    if header.kind is not Kind.STATUS:
        raise MalformedPacketError(f"a packet of kind {header.kind}")
    return decode_object(content)


def _silent(path: Path, why: str) -> UserError:
    return UserError(
        f"no camera tap serves {path}: {why}",
        f"Start it: {start_command('robot-tap')}",
        exit_code=ExitCode.UNREACHABLE,
    )
