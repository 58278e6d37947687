"""The connection that hands the file of an export from the recorder to the gateway, beside gRPC.

Two programs that pass the same bytes on cost twice the processor of one. So the recorder decides what may be
read, and the gateway reads it:

1. The gateway calls ExportRecording with the metadata KEY_HEADER, random bytes.
2. A recorder that can do this answers with the initial metadata OPENED_HEADER, and the header of the export.
3. The gateway connects to `socket_beside` of the recorder's socket, and sends the key.
4. The recorder sends ORDER, from where to where and how fast to read, with the file's descriptor, which is
   open for reading alone (SCM_RIGHTS, unix(7)).
5. The gateway answers TAKEN, and reads. It withholds the last block, and disconnects.
6. The call ends: with OK when the whole file has been verified, or at any time with the reason why no more of
   it may be read. The gateway closes the file.

The call carries the chunks instead where the gateway does not connect within CONNECT_WITHIN_S, as with a
recorder or a gateway that knows none of this, or where a limit of all exports together applies, which the
recorder keeps. The gateway need not know why. Pure.
"""

import struct
from pathlib import Path
from typing import Final

KEY_HEADER: Final = "x-export-file-key"
"""Metadata of the call: the key in hexadecimal digits."""
OPENED_HEADER: Final = "x-export-file"
"""Initial metadata: the file comes over the connection. Its value has no meaning."""
KEY_BYTES: Final = 16
CONNECT_WITHIN_S: Final = 2.0
"""From the call to TAKEN."""
ORDER: Final = struct.Struct(">QQQ")
"""The first byte, the one after the last, and how many may leave in a second; 0 for no limit."""
TAKEN: Final = b"\1"

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
