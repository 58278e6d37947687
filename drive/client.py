"""Looks at a running drive program from outside: as an observer of its socket, who moves nothing."""

import socket
from contextlib import closing
from pathlib import Path
from typing import Final

from google.protobuf.message import DecodeError

from common.errors import ExitCode, UserError
from drive.wire import MAX_MESSAGE_BYTES
from omniseer.drive.v1 import drive_pb2 as pb

_TIMEOUT_S: Final = 3.0
"""A report comes twice a second."""


def observed_state(path: Path) -> pb.ActualState:
    """Returns the next state that the program at this socket reports.

    Raises:
        UserError: nothing serves there, or it reports nothing in time.
    """
    try:
        with closing(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)) as link:
            link.settimeout(_TIMEOUT_S)
            link.connect(str(path))
            link.send(pb.ToDrive(hello=pb.Hello()).SerializeToString())
            while packet := link.recv(MAX_MESSAGE_BYTES):
                message = pb.FromDrive.FromString(packet)
                if message.HasField("actual"):
                    return message.actual
            reason = "it closed the connection"
    except TimeoutError:
        reason = f"it reports nothing within {_TIMEOUT_S:g} s"
    except (OSError, DecodeError) as error:
        reason = str(error)
    raise UserError(
        f"no drive program answers at {path}: {reason}",
        "Start it: robot-drive serve",
        exit_code=ExitCode.UNREACHABLE,
    )
