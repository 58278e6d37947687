"""Checks of endpoints: the gateway's own, and those of the programs that it speaks to."""

import grp
import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.bind import bracketed
from common.findings import Finding, good, note, wrong

_TIMEOUT_S: Final = 1.0


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
        why, remedy = "The gateway is not running", "Type: robot-gateway serve"
        return note("grpc", f"no server listens at {address}", why, remedy)
    except OSError as error:
        return wrong(
            "grpc",
            f"{address} can't be reached from this machine: {error}",
            "grpc.host must be an address of this machine",
            "'ip address' lists its addresses",
        )


def preview_endpoint(path: Path) -> Finding:
    """Checks whether the preview service accepts connections on its socket."""
    service = _Service("preview", "the preview service", "robot-preview", "preview.socket")
    return service.endpoint(path, "Without it there is a status, but no video")


def recorder_endpoint(path: Path) -> Finding:
    """Checks whether the recorder accepts connections on its socket."""
    service = _Service("recording", "the recorder", "robot-recorder", "recording.socket")
    return service.endpoint(path, "Without it recordings can't be started, stopped or copied")


@dataclass(frozen=True, slots=True)
class _Service:
    """A program that the gateway reaches by a Unix socket.

    Attributes:
        finding: name of the finding.
        name: of the service, for people.
        program: its command.
        key: of the configuration.
    """

    finding: str
    name: str
    program: str
    key: str

    def endpoint(self, path: Path, why: str) -> Finding:
        """Checks whether it accepts connections."""
        try:
            with socket.socket(socket.AF_UNIX) as probe:
                probe.settimeout(_TIMEOUT_S)
                probe.connect(str(path))
        except FileNotFoundError:
            what, remedy = f"{path} does not exist", f"Start {self.name}: {self.program} serve"
            if not path.parent.is_dir():
                own = self.name.removeprefix("the ").removesuffix(" service")
                remedy = f"Create the directory {path.parent}, or share it with the {own}'s container"
        except ConnectionRefusedError:
            what, remedy = f"{path} is left over from a service that ended", f"Start {self.name} again"
        except PermissionError:
            what, remedy = f"this user may not use {path}", _permission_remedy(path)
        except OSError as error:
            what, remedy = f"{path} can't be used: {error}", f"Set {self.key} to the service's own socket"
        else:
            return good(self.finding, f"{self.name} listens on {path}")
        return wrong(self.finding, what, why, remedy)


def _permission_remedy(path: Path) -> str:
    for owned in (path, path.parent):
        try:
            group = grp.getgrgid(owned.stat().st_gid).gr_name
        except (OSError, KeyError):
            continue
        return f"Run both programs with one group: sudo usermod -aG {group} $USER, and log in again"
    return f"Run both programs as one user (this one is {os.geteuid()})"
