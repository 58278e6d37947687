"""Binds gRPC servers to TCP ports and Unix sockets, and turns failures into user-facing errors.

gRPC itself only reports "failed to bind". A plain socket therefore binds first, to learn the errno, and gRPC
follows. If another program takes the address in between, the general error remains.
"""

import errno
import socket
import stat
from pathlib import Path
from typing import Final

import grpc

from common.addresses import bracketed
from common.errors import UserError
from common.socket_path import MAX_SOCKET_PATH

_SOCKET_MODE: Final = 0o660
_CONNECT_TIMEOUT_S: Final = 0.5


def bind_tcp(
    server: grpc.aio.Server, host: str, port: int, credentials: grpc.ServerCredentials | None = None
) -> int:
    """Binds the server to `host` and `port`; without `credentials` it serves plaintext.

    Returns:
        The bound port, which the kernel chooses if `port` is 0.

    Raises:
        UserError: the port is taken or not permitted, or the address does not belong to this machine.
    """
    _try_tcp(host, port)
    address = f"{bracketed(host)}:{port}"
    try:
        if credentials is None:
            return server.add_insecure_port(address)
        return server.add_secure_port(address, credentials)
    except RuntimeError as error:
        raise UserError(f"{address} can't be bound ({error})", "Choose another port or address") from error


def bind_unix(server: grpc.aio.Server, path: Path) -> None:
    """Binds the server to a Unix socket with mode 0660; replaces the stale socket of a server that died.

    Raises:
        UserError: another program serves at this path, or the path can't be used.
    """
    _try_unix(path)
    try:
        server.add_insecure_port(f"unix:{path}")
        path.chmod(_SOCKET_MODE)
    except (RuntimeError, OSError) as error:
        raise UserError(f"socket {path} can't be bound ({error})", "Choose another path") from error


def packet_socket(path: Path) -> socket.socket:
    """Returns a listening Unix socket of packets (SOCK_SEQPACKET), not blocking, with mode 0660.

    Raises:
        UserError: another program serves at this path, or the path can't be used.
    """
    return _unix_socket(path, socket.SOCK_SEQPACKET)


def stream_socket(path: Path) -> socket.socket:
    """As `packet_socket`, a stream of bytes (SOCK_STREAM)."""
    return _unix_socket(path, socket.SOCK_STREAM)


def _unix_socket(path: Path, kind: int) -> socket.socket:
    _try_unix(path, kind)
    listener = socket.socket(socket.AF_UNIX, kind | socket.SOCK_NONBLOCK)
    try:
        listener.bind(str(path))
        path.chmod(_SOCKET_MODE)
        listener.listen()
    except OSError as error:
        listener.close()
        raise UserError(f"socket {path} can't be bound ({error})", "Choose another path") from error
    return listener


def _try_tcp(host: str, port: int) -> None:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            # With SO_REUSEADDR, two sockets may bind one address as long as neither listens (socket(7)).
            probe.listen()
    except OSError as error:
        raise UserError(*_why_not(error, host, port)) from error


def _why_not(error: OSError, host: str, port: int) -> tuple[str, str]:
    if isinstance(error, socket.gaierror):
        return f"'{host}' is not an address or a known host name", "Use one of this machine's addresses"
    match error.errno:
        case errno.EADDRINUSE:
            return (
                f"port {port} on {host} is taken by another program",
                f"Stop it (ss -ltnp 'sport = :{port}' shows its name) or choose another port",
            )
        case errno.EADDRNOTAVAIL:
            return f"{host} is not an address of this machine", "'ip address' lists its addresses"
        case errno.EACCES:
            return f"this user may not use port {port}", "Choose port 1024 or higher"
        case _:
            return (
                f"{bracketed(host)}:{port} can't be bound: {error.strerror}",
                "Choose another port or address",
            )


def _try_unix(path: Path, kind: int = socket.SOCK_STREAM) -> None:
    if len(bytes(path)) > MAX_SOCKET_PATH:
        raise UserError(
            f"the path of socket {path} has {len(bytes(path))} bytes; Linux takes {MAX_SOCKET_PATH}",
            "Choose a shorter path",
        )
    try:
        if path.exists():
            _remove_dead(path, kind)
        with socket.socket(socket.AF_UNIX, kind) as probe:
            probe.bind(str(path))
        path.unlink()
    except OSError as error:
        raise UserError(
            f"socket {path} can't be created: {error.strerror}",
            f"{path.parent} must be a directory that this user may write to",
        ) from error


def _remove_dead(path: Path, kind: int) -> None:
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise UserError(f"{path} exists and is not a socket", "Remove it or choose another path")
    with socket.socket(socket.AF_UNIX, kind) as probe:
        probe.settimeout(_CONNECT_TIMEOUT_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except TimeoutError:
            pass  # A full accept queue: a live server that is slow.
    raise UserError(f"socket {path} is served by another program", "Stop it or choose another path")
