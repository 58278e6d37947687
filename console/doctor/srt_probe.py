"""Probes a UDP port for an SRT listener with the induction of a handshake, without opening a connection.

The listener answers it with a cookie and keeps no state (draft-sharabayko-srt 4.3.1.1); no viewer appears in
its statistics.
"""

import socket
import struct
import time
from typing import Final

_HANDSHAKE: Final = 0x8000_0000
"""Control packet, type handshake."""
_INDUCTION: Final = 1
_UDT_VERSION: Final = 4
_DATAGRAM: Final = 2
_MTU: Final = 1500
_WINDOW: Final = 8192
_OUR_ID: Final = 0x0D0C_7012
_HEADER: Final = struct.Struct(">IIII")
_BODY: Final = struct.Struct(">IHHIIIIII16s")
_SRT_VERSION: Final = 5
_SRT_MAGIC: Final = 0x4A17
_TRIES: Final = 4
_WAIT_S: Final = 0.3


def answers_as_srt(host: str, port: int) -> bool:
    """Returns whether an SRT listener answers there within about a second.

    Not at an address that is none: host and port are the robot's words.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.connect(address)
            # UDP loses packets: one try is not enough to call a port dead.
            return any(_ask(probe) for _ in range(_TRIES))
    except (OSError, UnicodeError, OverflowError):
        return False


def induction() -> bytes:
    """Returns the induction packet of a caller."""
    header = _HEADER.pack(_HANDSHAKE, 0, 0, 0)
    body = _BODY.pack(_UDT_VERSION, 0, _DATAGRAM, 0, _MTU, _WINDOW, _INDUCTION, _OUR_ID, 0, bytes(16))
    return header + body


def is_answer(packet: bytes) -> bool:
    """Returns whether a packet is a listener's answer to `induction`."""
    if len(packet) < _HEADER.size + _BODY.size:
        return False
    kind, _, _, destination = _HEADER.unpack_from(packet)
    version, _, extension, _, _, _, handshake, *_ = _BODY.unpack_from(packet, _HEADER.size)
    found = (kind, destination, version, extension, handshake)
    return found == (_HANDSHAKE, _OUR_ID, _SRT_VERSION, _SRT_MAGIC, _INDUCTION)


def _ask(probe: socket.socket) -> bool:
    until_s = time.monotonic() + _WAIT_S
    try:
        probe.send(induction())
        while (left_s := until_s - time.monotonic()) > 0:
            probe.settimeout(left_s)
            if is_answer(probe.recv(2048)):
                return True
    except OSError:
        # Refused (ICMP port unreachable) or timed out: the next try, or the verdict, follows.
        return False
    return False
