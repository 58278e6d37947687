"""Connection to the camera tap: frames of a topic, one permitted after the other. Knows no GStreamer.

| failure | raised |
|---|---|
| no tap, no socket, no permission | TapError at the connection |
| the tap ends or is killed | TapError: the kernel closes its end at once |
| it hangs, or nothing is published | nothing: `receive` returns None; a problem is what the tap knows of it |
| a packet that is none, memory that could shrink or is too small | TapError; descriptors are closed |
"""

import errno
import fcntl
import os
import socket
import time
from array import array
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.camera_tap import (
    LEAST_SEALS,
    MAX_PACKET_BYTES,
    READY,
    Header,
    Kind,
    MalformedPacketError,
    decode,
    decode_text,
    encode_examine,
    encode_watch,
)

CONNECT_S: Final = 2.0
_INT_BYTES: Final = array("i").itemsize


class TapError(Exception):
    """The camera tap does not deliver; the text says why, for people."""


@dataclass(frozen=True, slots=True)
class SharedFrame:
    """A frame in shared memory.

    Args:
        header: what it is.
        memory: descriptor, owned by the receiver of the frame.
    """

    header: Header
    memory: int


class TapClient:
    """A connection for one topic.

    Args:
        path: of the tap's socket.
        topic: to be shown.

    Attributes:
        problem: why no frames come, as far as the tap knows; empty if it knows of nothing.

    Raises:
        TapError: there is no connection.
    """

    def __init__(self, path: Path, topic: str) -> None:
        self.problem = ""
        self._socket = _connected(path, CONNECT_S)
        try:
            self._socket.send(encode_watch(topic))
            self._permit()
        except (OSError, TapError) as error:
            self._socket.close()
            raise TapError("the camera tap has closed the connection") from error

    def receive(self, timeout_s: float) -> SharedFrame | None:
        """Returns the next frame; None if something else has come, or nothing in time.

        Raises:
            TapError: there is no connection any more.
        """
        self._socket.settimeout(timeout_s)
        try:
            # Not recv_fds, which ignores its flags (Python 3.11): child processes would inherit the frame.
            packet, attached, _, _ = self._socket.recvmsg(
                MAX_PACKET_BYTES, socket.CMSG_LEN(_INT_BYTES), socket.MSG_CMSG_CLOEXEC
            )
        except TimeoutError:
            return None
        except ConnectionError as error:
            raise TapError("the camera tap has closed the connection") from error
        except OSError as error:
            raise TapError(f"the camera tap can't be read: {error.strerror}") from error
        descriptors = _descriptors(attached)
        try:
            frame = self._read(packet, descriptors)
        except MalformedPacketError as error:
            for each in descriptors:
                os.close(each)
            raise TapError(f"the camera tap sent {error}") from error
        if frame:
            try:
                self._permit()
            except TapError:
                os.close(frame.memory)
                raise
        return frame

    def shut_down(self) -> None:
        """Ends a `receive` in another thread at once."""
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError as error:
            if error.errno not in (errno.ENOTCONN, errno.EBADF):
                raise

    def close(self) -> None:
        """Closes the connection."""
        self._socket.close()

    def _permit(self) -> None:
        try:
            self._socket.send(READY)
        except OSError as error:
            raise TapError("the camera tap has closed the connection") from error

    def _read(self, packet: bytes, descriptors: list[int]) -> SharedFrame | None:
        if not packet:
            raise TapError("the camera tap has closed the connection")
        header, content = decode(packet)
        if header.kind is not Kind.FRAME:
            if descriptors:
                raise MalformedPacketError("a descriptor without a frame")
            if header.kind is Kind.PROBLEM:
                self.problem = decode_text(content)
            return None
        if len(descriptors) != 1:
            raise MalformedPacketError(f"a frame with {len(descriptors)} descriptors")
        _check_memory(descriptors[0], header.size)
        return SharedFrame(header, descriptors[0])


def _descriptors(attached: Sequence[tuple[int, int, bytes]]) -> list[int]:
    """Returns the descriptors that came with a packet; the kernel has closed those without room."""
    found = array("i")
    for level, kind, content in attached:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
            found.frombytes(content[: len(content) // _INT_BYTES * _INT_BYTES])
    return list(found)


def connection_problem(path: Path) -> str:
    """Returns why no tap can be connected to, for people; empty if one can. Never waits."""
    try:
        _connected(path, 0.0).close()
    except TapError as error:
        return str(error)
    return ""


def topic_problem(path: Path, topic: str, until_s: float) -> str | None:
    """Returns why a topic can't be shown, for people; empty if it can, None if the tap does not say in time.

    Args:
        path: of the tap's socket.
        topic: its name.
        until_s: when the answer is due, on `time.monotonic()`.
    """
    left_s = until_s - time.monotonic()
    if left_s <= 0:
        return None
    try:
        with closing(_connected(path, 0.0)) as connection:
            connection.settimeout(left_s)
            connection.send(encode_examine(topic))
            packet = connection.recv(MAX_PACKET_BYTES)
        if not packet:
            return None
        header, content = decode(packet)
    except TapError as error:
        return f"the camera tap can't be asked for {topic}: {error}"
    except MalformedPacketError as error:
        return f"the camera tap sent {error}"
    except OSError:  # Among them that nothing has come in time.
        return None
    # An older tap sends its state: all that can be known of it is that it runs.
    return decode_text(content) if header.kind is Kind.PROBLEM else ""


def _connected(path: Path, timeout_s: float) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.settimeout(timeout_s)
    try:
        connection.connect(str(path))
    except OSError as error:
        connection.close()
        if isinstance(error, FileNotFoundError | ConnectionRefusedError):
            raise TapError("it is not running") from error
        raise TapError(error.strerror or "it does not respond") from error
    return connection


def _check_memory(descriptor: int, size: int) -> None:
    """Makes sure that a frame's bytes are there, and stay: reading beyond them would end this process."""
    try:
        seals = fcntl.fcntl(descriptor, fcntl.F_GET_SEALS)
    except OSError as error:
        raise MalformedPacketError("a frame that is not in a memfd") from error
    if seals & LEAST_SEALS != LEAST_SEALS:
        raise MalformedPacketError("a frame in memory that may shrink or change")
    if (there := os.fstat(descriptor).st_size) < size:
        raise MalformedPacketError(f"a frame of {size} bytes in memory of {there}")
