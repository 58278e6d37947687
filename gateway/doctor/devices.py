"""Checks of the device files of cameras and encoders, and of this user's permissions on them."""

import grp
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from common.findings import Finding, good, note, wrong

_FAMILIES: Final = (
    ("video*", "camera or encoder"),
    ("dri/renderD*", "graphics, for its encoder"),
    ("mpp_service", "Rockchip's encoder"),
    ("rga", "Rockchip's image scaler"),
    ("dma_heap/*", "memory shared with encoders"),
    ("nvidia[0-9]*", "graphics, for its encoder"),
)


def device_findings(dev: Path = Path("/dev")) -> Iterator[Finding]:
    """Yields one finding per device file, or one note if there is none."""
    found = [(path, use) for pattern, use in _FAMILIES for path in sorted(dev.glob(pattern))]
    for path, use in found:
        yield _finding(path, use)
    if not found:
        yield note(
            "devices",
            "no camera, graphics or encoder device on this machine",
            "The preview can only show a test pattern and encode on the CPU",
            "In a container: pass the devices through (docs/configuration.md lists what the source needs)",
        )


def _finding(path: Path, use: str) -> Finding:
    check = f"device.{path.name}"
    if os.access(path, os.R_OK | os.W_OK):
        return good(check, f"{path} ({use}) is accessible")
    group = _group(path)
    return wrong(
        check,
        f"{path} ({use}) exists, but this user has no access",
        f"It belongs to the group '{group}'",
        f"Type: sudo usermod -aG {group} $USER, and log in again; in a container: group_add: [{group}]",
    )


def _group(path: Path) -> str:
    owner = path.stat()
    if not owner.st_mode & stat.S_IRGRP:
        return "root"
    try:
        return grp.getgrgid(owner.st_gid).gr_name
    except KeyError:
        return str(owner.st_gid)
