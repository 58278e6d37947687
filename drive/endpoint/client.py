"""Looks at a running drive program from outside: as an observer of its socket, who moves nothing."""

import socket
from contextlib import closing
from pathlib import Path
from typing import Final

from google.protobuf.message import DecodeError

from common.errors import ExitCode, UserError
from drive.endpoint.wire import MAX_MESSAGE_BYTES
from omniseer.drive.v1 import drive_pb2 as pb

_TIMEOUT_S: Final = 3.0
"""A report comes twice a second."""
_MAX_PACKETS: Final = 64
"""Read at once; what is left is read the next time."""


class StateReader:
    """Reads the states that a drive program reports, until it is closed.

    Args:
        path: of its socket.

    Raises:
        OSError: nothing listens there.
    """

    def __init__(self, path: Path) -> None:
        self._link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._link.settimeout(_TIMEOUT_S)
            self._link.connect(str(path))
            self._link.send(pb.ToDrive(hello=pb.Hello()).SerializeToString())
        except OSError:
            self._link.close()
            raise

    def close(self) -> None:
        """Disconnects."""
        self._link.close()

    def fileno(self) -> int:
        """Returns the descriptor that is readable when there is something to read."""
        return self._link.fileno()

    def next(self) -> pb.ActualState:
        """Waits for the next state, and returns it.

        Raises:
            TimeoutError: there is none in time.
            OSError: the connection has ended.
            DecodeError: it sends what is no message.
        """
        self._link.settimeout(_TIMEOUT_S)
        while True:
            if (state := self._read()) is not None:
                return state

    def newest(self) -> pb.ActualState | None:
        """Returns the newest state that has arrived; None if there is no new one. Never waits.

        Raises:
            OSError: the connection has ended.
            DecodeError: it sends what is no message.
        """
        self._link.setblocking(False)
        newest = None
        try:
            for _ in range(_MAX_PACKETS):
                newest = self._read() or newest
        except BlockingIOError:
            pass
        return newest

    def _read(self) -> pb.ActualState | None:
        packet = self._link.recv(MAX_MESSAGE_BYTES)
        if not packet:
            raise ConnectionResetError("it closed the connection")
        message = pb.FromDrive.FromString(packet)
        return message.actual if message.HasField("actual") else None


def observed_state(path: Path) -> pb.ActualState:
    """Returns the next state that the program at this socket reports.

    Raises:
        UserError: nothing serves there, or it reports nothing in time.
    """
    try:
        with closing(StateReader(path)) as reader:
            return reader.next()
    except TimeoutError:
        reason = f"it reports nothing within {_TIMEOUT_S:g} s"
    except (OSError, DecodeError) as error:
        reason = str(error)
    raise UserError(
        f"no drive program answers at {path}: {reason}",
        "Start it: robot-drive serve",
        exit_code=ExitCode.UNREACHABLE,
    )
