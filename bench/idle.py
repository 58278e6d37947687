"""What both programs need while the preview is off: after the start, and after it was on once."""

import tempfile
import time
from pathlib import Path
from typing import Final

from bench.processes import cpu_share, resident_mib
from bench.product import Product, product
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video.viewing import PATIENCE_S, watch
from console.client import PreviewProfile
from console.viewer.redial import address_of
from tests.support.receiver import Receiver

SETTLE_S: Final = 5.0
"""After the start (discovery, trials of the encoders) and after the preview was switched off."""
WINDOW_S: Final = 8.0
_WATCHED_S: Final = 5.0
_STATES: Final = {
    "": "preview off, a robot publishing on all its topics",
    "_after": "after the preview was on once",
}
"""Ends of the rows' names, and what they are about."""
_RSS_MIB: Final = {"": 220, "_after": 240}
"""x264 and libsrt keep buffers of the stream that ended."""


def run(names: list[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, product(Path(directory)) as running:
        time.sleep(SETTLE_S)
        rows = _rows(running, "")
        _preview_on_and_off(running)
        time.sleep(SETTLE_S)
        rows += _rows(running, "_after")
    return [row for row in rows if not names or row.name in names]


def _rows(running: Product, state: str) -> list[Row]:
    cpu_percent, sizes_mib = [], []
    for _ in range(FEWEST_ROUNDS):
        # One window after the other: reading /proc for one must not count for the other.
        gateway, preview = (cpu_share(each.pid, WINDOW_S) for each in (running.gateway, running.preview))
        sizes = resident_mib(running.gateway.pid), resident_mib(running.preview.pid)
        cpu_percent.append(gateway.whole + preview.whole)
        sizes_mib.append(sum(sizes))
        log(
            f"idle{state}: gateway {gateway.whole:.2f} % (of it Fast DDS {gateway.middleware:.2f} %) and"
            f" {sizes[0]:.0f} MiB, preview {preview.whole:.2f} % and {sizes[1]:.0f} MiB"
        )
    return [
        Row(
            name=f"idle.cpu{state}",
            what=f"CPU of gateway and preview service together, {_STATES[state]}",
            unit="% of a core",
            values=cpu_percent,
            bar=8,
        ),
        Row(
            name=f"idle.rss{state}_mib",
            what=f"resident memory of both, {_STATES[state]}",
            unit="MiB",
            values=sizes_mib,
            bar=_RSS_MIB[state],
        ),
    ]


def _preview_on_and_off(running: Product) -> None:
    address = address_of(running.client.enable_preview(PreviewProfile.BALANCED).preview)
    if address is None:
        raise RuntimeError("the preview does not run")
    with Receiver(address, queue_size=4) as viewer:
        viewer.next_frame(PATIENCE_S)
        watch(viewer, _WATCHED_S)
    running.client.disable_preview()
