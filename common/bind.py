"""Binding a gRPC server to a TCP port or a Unix socket; what can go wrong becomes a sentence for a person.

gRPC itself only says "failed to bind". So a plain socket tries first and tells the reason, and gRPC
follows; should another program slip in between, the error is the general one.
"""

import errno
import socket
import stat
from pathlib import Path
from typing import Final

import grpc

from common.errors import UserError

_MAX_SOCKET_PATH: Final = 107
"""Bytes in a Unix socket's path that Linux takes."""
_SOCKET_MODE: Final = 0o660
_CONNECT_TIMEOUT_S: Final = 0.5


def bind_tcp(
    server: grpc.aio.Server, host: str, port: int, credentials: grpc.ServerCredentials | None = None
) -> int:
    """Binds to `host` and `port` (0: any free one); plaintext without `credentials`.

    Returns:
        The port.

    Raises:
        UserError: the port is taken or not allowed, or the address is not one of this machine.
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
    """Binds to a Unix socket that this user and group may use, replacing what a dead server left behind.

    Raises:
        UserError: another program serves there, or the path can't be used.
    """
    _try_unix(path)
    try:
        server.add_insecure_port(f"unix:{path}")
        path.chmod(_SOCKET_MODE)
    except (RuntimeError, OSError) as error:
        raise UserError(f"socket {path} can't be bound ({error})", "Choose another path") from error


def bracketed(host: str) -> str:
    """The host as it is written before a colon and a port: IPv6 addresses in brackets."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def _try_tcp(host: str, port: int) -> None:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            # Two sockets may share an address while neither listens.
            probe.listen()
    except OSError as error:
        raise UserError(*_why_not(error, host, port)) from error


def _why_not(error: OSError, host: str, port: int) -> tuple[str, str]:
    if isinstance(error, socket.gaierror):
        return f"'{host}' is not an address or a known name", "Name one of this machine's addresses"
    match error.errno:
        case errno.EADDRINUSE:
            return (
                f"port {port} on {host} is taken by another program",
                f"Stop that one (ss -ltnp 'sport = :{port}' names it) or choose another port",
            )
        case errno.EADDRNOTAVAIL:
            return f"{host} is not an address of this machine", "'ip address' lists those that are"
        case errno.EACCES:
            return f"port {port} is not allowed for this user", "Choose one from 1024 up"
        case _:
            return (
                f"{bracketed(host)}:{port} can't be bound: {error.strerror}",
                "Choose another port or address",
            )


def _try_unix(path: Path) -> None:
    if len(bytes(path)) > _MAX_SOCKET_PATH:
        raise UserError(
            f"socket {path} has a path of {len(bytes(path))} bytes, Linux takes {_MAX_SOCKET_PATH}",
            "Choose a shorter path",
        )
    try:
        if path.exists():
            _remove_dead(path)
        with socket.socket(socket.AF_UNIX) as probe:
            probe.bind(str(path))
        path.unlink()
    except OSError as error:
        raise UserError(
            f"socket {path} can't be made: {error.strerror}",
            f"{path.parent} must be a directory that this user may write to",
        ) from error


def _remove_dead(path: Path) -> None:
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise UserError(f"{path} exists and is not a socket", "Remove it or choose another path")
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(_CONNECT_TIMEOUT_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except TimeoutError:
            pass  # Somebody listens there and is slow: as good as an answer.
    raise UserError(f"socket {path} is served by another program", "Stop that one or choose another path")
