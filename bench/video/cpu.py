"""CPU of the preview service against gst-launch-1.0 with the same encoder, told the same.

Whoever sends fewer pictures needs less: a window in which too many are missing does not count, on either
side.
"""

import statistics
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from bench.processes import cpu_share
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.progress import tell
from bench.video.viewing import Viewer, watch
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.settings import vbv_ms
from tests.support.ports import free_udp_port

ROUNDS = 7
TRIES = 12
"""At most, to get so many rounds."""
WINDOW_S = 7.0
LEAST_PICTURES = int(0.95 * 30 * WINDOW_S)
SETTLE_S = 1.5
LATENCY_MS = 125
BITRATE_KBPS = 2500
GOP_FRAMES = 60


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        port = free_udp_port()
        theirs: list[float] = []
        ours: list[float] = []
        for _ in range(TRIES):
            with (
                reference.sender(source, port, LATENCY_MS, _same_encoder()) as process,
                reference.PlainViewer(port, LATENCY_MS) as viewer,
            ):
                reference_percent = _percent(viewer, process.pid)
            with robot.preview(), robot.viewer() as viewer:
                percent = _percent(viewer, robot.service.pid)
            if percent is None or reference_percent is None:
                continue
            tell(
                f"CPU with a viewer: gst-launch-1.0 {reference_percent:.1f} %, ours {percent:.1f} % of a core"
            )
            theirs.append(reference_percent)
            ours.append(percent)
            if len(ours) == ROUNDS:
                break
        else:
            raise RuntimeError(
                f"pictures were missing in too many of {TRIES} rounds: the machine is too busy"
            )
    return [
        Row(
            name="video.cpu",
            what="CPU of the preview service against gst-launch-1.0 with the same encoder settings",
            unit="% of a core",
            value=statistics.median(ours),
            reference=statistics.median(theirs),
            bar=1.10,
        )
    ]


def _percent(viewer: Viewer, pid: int) -> float | None:
    """Of one core, over a window; None when pictures were missing in it."""
    watch(viewer, SETTLE_S)
    with ThreadPoolExecutor(1) as measuring:
        share = measuring.submit(cpu_share, pid, WINDOW_S)
        pictures = len(watch(viewer, WINDOW_S))
    if pictures < LEAST_PICTURES:
        tell(f"CPU with a viewer: {pictures} pictures in {WINDOW_S:g} s are too few, once more")
        return None
    return share.result().whole


def _same_encoder() -> str:
    """What the preview service tells x264enc for BALANCED, as a command line says it."""
    spelling = CATALOGUE["x264"].spelling
    values = {
        **spelling.fixed,
        "bitrate": BITRATE_KBPS,
        "key-int-max": GOP_FRAMES,
        spelling.vbv_ms: vbv_ms(BITRATE_KBPS),
    }
    return " ".join(["x264enc", *(f"{name}={value}" for name, value in values.items())])
