"""A frame on its way to the preview: sealed shared memory, and the packet that carries its descriptor."""

import fcntl
import os
import socket
from collections.abc import Sequence
from itertools import islice
from typing import Final

from common.camera_tap import Header, Kind
from tap.image import Frame

_SEALS: Final = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_WRITE | fcntl.F_SEAL_SEAL
_PIECES_AT_ONCE: Final = 1024
"""IOV_MAX of Linux (limits.h)."""


def send_frame(connection: socket.socket, frame: Frame, captured_ns: int) -> None:
    """Copies a frame into memory of its own, and hands it over. Never waits for the reader.

    Raises:
        OSError: the reader is gone or does not read, or there is no memory.
    """
    memory = os.memfd_create("camera-frame", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    try:
        _write(memory, frame.pieces)
        fcntl.fcntl(memory, fcntl.F_ADD_SEALS, _SEALS)
        header = Header(Kind.FRAME, frame.width, frame.height, frame.size, captured_ns, frame.form)
        socket.send_fds(connection, [header.encode()], [memory], socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
    finally:
        os.close(memory)


def _write(memory: int, pieces: Sequence[memoryview | bytes]) -> None:
    remaining = iter(pieces)
    while batch := list(islice(remaining, _PIECES_AT_ONCE)):
        expected = sum(len(piece) for piece in batch)
        if os.writev(memory, batch) != expected:
            raise OSError(28, "there is no memory for a frame")
