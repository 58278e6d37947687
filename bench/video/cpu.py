"""CPU of the preview service against gst-launch-1.0 with the same encoder, told the same."""

import statistics
from pathlib import Path

from bench.processes import cpu_share
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.progress import tell
from bench.video.viewing import watch
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.settings import vbv_ms
from tests.support.ports import free_udp_port

ROUNDS = 5
WINDOW_S = 5.0
SETTLE_S = 1.5
LATENCY_MS = 125
BITRATE_KBPS = 2500
GOP_FRAMES = 60


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        port = free_udp_port()
        theirs, ours = [], []
        for _ in range(ROUNDS):
            with (
                reference.sender(source, port, LATENCY_MS, _same_encoder()) as process,
                reference.PlainViewer(port, LATENCY_MS) as viewer,
            ):
                watch(viewer, SETTLE_S)
                theirs.append(cpu_share(process.pid, WINDOW_S).whole)
            with robot.preview(), robot.viewer() as viewer:
                watch(viewer, SETTLE_S)
                ours.append(cpu_share(robot.service.pid, WINDOW_S).whole)
            tell(f"CPU with a viewer: gst-launch-1.0 {theirs[-1]:.1f} %, ours {ours[-1]:.1f} % of a core")
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
