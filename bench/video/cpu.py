"""CPU of the preview service against gst-launch-1.0 with the same encoder and the same settings.

Both send at once, the same frames to one viewer each, and are measured in the same window: what else the
machine does, and how warm its caches are, is the same for both. A sender of fewer frames needs less, so
a window in which too many are missing on either side does not count.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from bench.processes import cpu_share
from bench.progress import log
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import Camera, camera
from bench.video.viewing import Viewer, watch
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.properties import vbv_ms
from tests.support.free import free_udp_port

ROUNDS = 7
TRIES = 12
"""At most, to get so many rounds."""
WINDOW_S = 8.0
LEAST_FRAMES = int(0.95 * 30 * WINDOW_S)
SETTLE_S = 1.5
LATENCY_MS = 125
BITRATE_KBPS = 2500
GOP_FRAMES = 60


@dataclass(frozen=True, slots=True)
class _Round:
    """In percent of a core."""

    theirs: float
    ours: float


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        rounds: list[_Round] = []
        discarded = 0
        for _ in range(TRIES):
            if (found := _round(source, robot)) is None:
                discarded += 1
            else:
                rounds.append(found)
            if len(rounds) == ROUNDS:
                break
        else:
            raise RuntimeError(f"frames were missing in too many of {TRIES} rounds: the machine is too busy")
    return [
        Row(
            name="video.cpu",
            what="CPU of the preview service against gst-launch-1.0 with the same encoder settings",
            unit="% of a core",
            values=[each.ours for each in rounds],
            references=[each.theirs for each in rounds],
            discarded=discarded,
            bar=1.10,
        )
    ]


def _round(source: Camera, robot: product.Robot) -> _Round | None:
    """None when frames were missing."""
    port = free_udp_port()
    with (
        reference.sender(source, port, LATENCY_MS, _same_encoder()) as process,
        reference.viewer(port, LATENCY_MS) as their_viewer,
        robot.preview(),
        robot.viewer() as our_viewer,
        ThreadPoolExecutor(4) as measuring,
    ):
        viewers: tuple[Viewer, ...] = (their_viewer, our_viewer)
        list(measuring.map(lambda viewer: watch(viewer, SETTLE_S), viewers))
        shares = [measuring.submit(cpu_share, pid, WINDOW_S) for pid in (process.pid, robot.service.pid)]
        frames = list(measuring.map(lambda viewer: len(watch(viewer, WINDOW_S)), viewers))
        found = _Round(*(share.result().whole for share in shares))
    line = f"gst-launch-1.0 {found.theirs:.1f} %, ours {found.ours:.1f} % of a core"
    if min(frames) < LEAST_FRAMES:
        log(f"CPU with a viewer: {line}, but {min(frames)} frames in {WINDOW_S:g} s are too few")
        return None
    log(f"CPU with a viewer: {line}")
    return found


def _same_encoder() -> str:
    """What the preview service tells x264enc for BALANCED, as a command line says it."""
    properties = CATALOGUE["x264"].properties
    values = {
        **properties.fixed,
        "bitrate": BITRATE_KBPS,
        "key-int-max": GOP_FRAMES,
        properties.vbv_ms: vbv_ms(BITRATE_KBPS),
    }
    return " ".join(["x264enc", *(f"{name}={value}" for name, value in values.items())])
