"""Checks of the gateway's own endpoint, and of those of the programs that it connects to."""

import grp
import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.addresses import bracketed
from common.findings import Finding, good, note, wrong
from common.start_command import start_command

_TIMEOUT_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Service:
    """A program that the gateway connects to.

    Attributes:
        check: names the finding.
        name: for people.
        kind: of its Unix socket.
        key: of the configuration, with its socket.
        program: its command.
        without_it: what does not work then.
    """

    check: str
    name: str
    kind: socket.SocketKind
    key: str
    program: str
    without_it: str


PREVIEW: Final = Service(
    check="preview",
    name="the preview service",
    kind=socket.SOCK_STREAM,
    key="preview.socket",
    program="robot-preview",
    without_it="Without it there is a status, but no video",
)
DRIVE: Final = Service(
    check="drive",
    name="the drive program",
    kind=socket.SOCK_SEQPACKET,
    key="teleop.socket",
    program="robot-drive",
    without_it="Without it no one can drive",
)
RECORDER: Final = Service(
    check="recording",
    name="the recorder",
    kind=socket.SOCK_STREAM,
    key="recording.socket",
    program="robot-recorder",
    without_it="Without it recordings can't be started, stopped or copied",
)
BRIDGE: Final = Service(
    check="bridge",
    name="the bridge",
    kind=socket.SOCK_STREAM,
    key="bridge.socket",
    program="robot-bridge",
    without_it="Without it nothing is sent to the fleet; the robot works",
)


def operator_endpoint(host: str, port: int) -> Finding:
    """Checks whether a server accepts connections at the gateway's address, or could."""
    address = f"{bracketed(host)}:{port}"
    if port == 0:
        return note("grpc", "grpc.port is 0: each start takes another port", "Operators can't know it")
    # A server that listens on all addresses is reached by the loopback address.
    reachable = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104  # binds nothing
    try:
        with socket.create_connection((reachable, port), timeout=_TIMEOUT_S):
            return good("grpc", f"a server listens at {address}")
    except ConnectionRefusedError:
        why, remedy = "The gateway is not running", f"Type: {start_command('robot-gateway')}"
        return note("grpc", f"no server listens at {address}", why, remedy)
    except OSError as error:
        return wrong(
            "grpc",
            f"{address} can't be reached from this machine: {error}",
            "grpc.host must be an address of this machine",
            "'ip address' lists its addresses",
        )


def service_endpoint(service: Service, path: Path) -> Finding:
    """Checks whether a service accepts connections on its socket."""
    try:
        with socket.socket(socket.AF_UNIX, service.kind) as probe:
            probe.settimeout(_TIMEOUT_S)
            probe.connect(str(path))
    except FileNotFoundError:
        what, remedy = f"{path} does not exist", f"Start {service.name}: {start_command(service.program)}"
        if not path.parent.is_dir():
            remedy = f"Create the directory {path.parent}, or share it with the container of {service.name}"
    except ConnectionRefusedError:
        what = f"{path} is left over from a program that ended"
        remedy = f"Start {service.name} again: {start_command(service.program)}"
    except PermissionError:
        what, remedy = f"this user may not use {path}", _permission_remedy(path)
    except OSError as error:
        what, remedy = f"{path} can't be used: {error}", f"Set {service.key} to the socket of {service.name}"
    else:
        return good(service.check, f"{service.name} listens on {path}")
    return wrong(service.check, what, service.without_it, remedy)


def _permission_remedy(path: Path) -> str:
    for owned in (path, path.parent):
        try:
            group = grp.getgrgid(owned.stat().st_gid).gr_name
        except (OSError, KeyError):
            continue
        return f"Run both programs with one group: sudo usermod -aG {group} $USER, and log in again"
    return f"Run both programs as one user (this one is {os.geteuid()})"
