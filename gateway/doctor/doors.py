"""The gateway's two doors: where operators call, and where the preview service listens."""

import grp
import os
import socket
from pathlib import Path
from typing import Final

from common.bind import bracketed
from common.findings import Finding, good, note, wrong

_WITHIN_S: Final = 1.0


def operator_door(host: str, port: int) -> Finding:
    """Whether a gateway serves there, or could."""
    where = f"{bracketed(host)}:{port}"
    if port == 0:
        return note("grpc", "grpc.port is 0: each start takes another port", "Operators can't know it")
    try:
        with socket.create_connection((_reachable(host), port), timeout=_WITHIN_S):
            return good("grpc", f"something serves at {where}")
    except ConnectionRefusedError:
        return note(
            "grpc", f"nothing serves at {where}", "The gateway does not run", "Type: robot-gateway serve"
        )
    except OSError as error:
        return wrong(
            "grpc",
            f"{where} can't be reached from this machine: {error}",
            "grpc.host must be an address of this machine",
            "'ip address' lists those that are",
        )


def _reachable(host: str) -> str:
    """Where a server that listens on `host` is called from the same machine."""
    return {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)


def preview_door(path: Path) -> Finding:
    """Whether the preview service answers on its socket, and if not, why not."""
    try:
        with socket.socket(socket.AF_UNIX) as probe:
            probe.settimeout(_WITHIN_S)
            probe.connect(str(path))
    except FileNotFoundError:
        what, remedy = f"{path} is not there", "Start the preview service: robot-preview serve"
        if not path.parent.is_dir():
            remedy = f"Make the directory {path.parent}, or share it with the preview's container"
    except ConnectionRefusedError:
        what, remedy = f"{path} is left over from a service that ended", "Start the preview service again"
    except PermissionError:
        what, remedy = f"this user may not use {path}", _how_to_be_let_in(path)
    except OSError as error:
        what, remedy = f"{path} can't be used: {error}", "Set preview.socket to the service's own socket"
    else:
        return good("preview", f"the preview service listens on {path}")
    return wrong("preview", what, "Without it there is a status, but no video", remedy)


def _how_to_be_let_in(path: Path) -> str:
    for place in (path, path.parent):
        try:
            group = grp.getgrgid(place.stat().st_gid).gr_name
        except (OSError, KeyError):
            continue
        return f"Run both programs with one group: sudo usermod -aG {group} $USER, and log in again"
    return f"Run both programs as one user (this one is {os.geteuid()})"
