"""HTTP/2 frames and HPACK headers by hand (RFC 9113, RFC 7541), for callers that no library would be."""

from typing import Final

PREFACE: Final = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RST_STREAM, SETTINGS, PING, GOAWAY, WINDOW_UPDATE, CONTINUATION = (
    0,
    1,
    2,
    3,
    4,
    6,
    7,
    8,
    9,
)
ACK: Final = 1
END_STREAM: Final = 1
END_HEADERS: Final = 4
LONGEST_FRAME: Final = 16_384


def frame(
    kind: int, payload: bytes = b"", *, stream: int = 0, flags: int = 0, length: int | None = None
) -> bytes:
    """One HTTP/2 frame, with a length that may lie."""
    size = len(payload) if length is None else length
    return size.to_bytes(3, "big") + bytes((kind, flags)) + stream.to_bytes(4, "big") + payload


def literal(name: bytes, value: bytes) -> bytes:
    """One header, spelled out: HPACK without any table."""
    return b"\x00" + _length(name) + name + _length(value) + value


def _length(text: bytes) -> bytes:
    size = len(text)
    if size < 127:
        return bytes((size,))
    size, coded = size - 127, bytearray((127,))
    while size >= 128:
        coded.append(size % 128 + 128)
        size //= 128
    return bytes((*coded, size))


BEGINNING: Final = PREFACE + frame(SETTINGS)


def call_headers(path: str) -> bytes:
    """The headers of a call of this method, "/package.Service/Method"."""
    return b"".join(
        literal(name, value)
        for name, value in (
            (b":method", b"POST"),
            (b":scheme", b"http"),
            (b":path", path.encode()),
            (b":authority", b"robot"),
            (b"te", b"trailers"),
            (b"content-type", b"application/grpc"),
        )
    )


GET_SYSTEM_STATUS: Final = call_headers("/omniseer.gateway.v1.RobotGateway/GetSystemStatus")
STOP_ROBOT: Final = call_headers("/omniseer.gateway.v1.TeleopService/StopRobot")
