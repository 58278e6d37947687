"""Handshakes of SRT by hand, without end: `python -m tests.support.srt_stranger SOURCE PORT`.

As far as a caller gets that does not know the passphrase: it has the listener's cookie, asks for a
connection, and begins another one from the next port (draft-sharabayko-srt-01, section 3.2.1).
"""

import itertools
import socket
import struct
import sys
import time

PACKET = struct.Struct(">IIII IHHIIIIII 16s")
"""Header of a handshake packet, then: version, encryption, extension, sequence number, largest packet,
window, type, socket ID, cookie, address."""
HANDSHAKE = 0x8000_0000
INDUCTION, CONCLUSION = 1, 0xFFFF_FFFF
ANSWER_WITHIN_S = 0.5
PAUSE_S = 0.01


def packet(version: int, kind: int, number: int, cookie: int) -> bytes:
    extension = 0x2 if version == 4 else 0  # UDT_DGRAM; none
    return PACKET.pack(
        HANDSHAKE, 0, 0, 0, version, 0, extension, 1, 1500, 8192, kind, number, cookie, bytes((1, 0, 0, 127))
    )


def main(source: str, port: int) -> None:
    for number in itertools.count(1):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as caller:
            caller.bind((source, 0))
            caller.settimeout(ANSWER_WITHIN_S)
            caller.connect(("127.0.0.1", port))
            try:
                caller.send(packet(4, INDUCTION, number, 0))
                answer = caller.recv(1500)
                cookie = PACKET.unpack_from(answer)[12]
                caller.send(packet(5, CONCLUSION, number, cookie))
            except (TimeoutError, ConnectionRefusedError):
                continue
        time.sleep(PAUSE_S)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
