"""The connection that carries the chunks of an export from the recorder to the gateway, beside gRPC.

gRPC copies and frames each chunk several times on its way through a Unix socket, which takes more of a
processor than reading, hashing and sending the file. So the two agree on a connection of the export's own:

1. The gateway calls ExportRecording with the metadata KEY_HEADER, random bytes.
2. A recorder that can do this answers with the initial metadata CARRIED_HEADER, and the header of the export.
3. The gateway connects to `socket_beside` of the recorder's socket, and sends the key.
4. The recorder sends the chunks there, each as a length (u32, big endian) and a serialised
   ExportRecordingResponse, and closes the connection.
5. The call ends: with OK, or with the reason why there are no more chunks.

The call carries the chunks instead where the gateway has not connected within CONNECT_WITHIN_S, as with a
recorder or a gateway that knows none of this. The gateway need not know which of the two it was: it takes
what the connection has, then what the call has. Pure.
"""

import struct
from pathlib import Path
from typing import Final

KEY_HEADER: Final = "x-export-key"
"""Metadata of the call: the key in hexadecimal digits."""
CARRIED_HEADER: Final = "x-export-carried"
"""Initial metadata: the chunks come over the connection. Its value has no meaning."""
KEY_BYTES: Final = 16
CONNECT_WITHIN_S: Final = 2.0
"""From the call to the key's last byte."""
LENGTH: Final = struct.Struct(">I")
MAX_MESSAGE_BYTES: Final = 256 * 1024 + 64
"""A chunk, with what frames it in its message."""

_SUFFIX: Final = ".exports"


def socket_beside(socket: Path) -> Path:
    """Returns where the recorder takes these connections, beside the socket on which it serves calls."""
    return socket.with_name(socket.name + _SUFFIX)


def key_of(digits: object) -> bytes | None:
    """Returns the key of a call's metadata; None if it is none."""
    try:
        key = bytes.fromhex(digits) if isinstance(digits, str) else b""
    except ValueError:
        return None
    return key if len(key) == KEY_BYTES else None
