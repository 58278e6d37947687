"""CPU of a camera that is a ROS topic, against the same frames through GStreamer's shared memory.

What counts is the whole cost beside the camera: for the topic that of the tap, the middleware's threads
in it included, and of the preview; for shared memory that of the preview alone. In turns, with the same
footage, encoder and profile. The camera's node and the writer of the shared memory are not counted.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from bench.processes import cpu_share
from bench.progress import log
from bench.ros_domain import ros_domain
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign
from bench.video.camera import camera
from tests.support.running_preview import RunningPreview
from tests.support.running_tap import RunningTap

ROUNDS: Final = FEWEST_ROUNDS
TOPIC: Final = "/bench/image_raw"
FPS: Final = 30
SETTLE_S: Final = 1.5
WINDOW_S: Final = 5.0
_WITHIN_S: Final = 30.0
_BAR: Final = 1.6
"""Two more processes pass each frame on: the middleware and the tap."""


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    topic: list[float] = []
    shared: list[float] = []
    taps: list[float] = []
    with camera(workdir, FPS) as source:
        description = {"kind": "gst", "description": source.source}
        for _ in range(ROUNDS):
            with _directory() as directory, ros_domain():
                shared.append(_preview_share(directory, {"source": description})[0])
            with _directory() as directory, ros_domain(), _publishing(workdir / "footage.nv12"):
                with RunningTap(directory) as tap:
                    settings = {
                        "source": {"kind": "ros", "topic": TOPIC, "fps": FPS},
                        "camera_tap": {"socket": str(tap.socket)},
                    }
                    preview, taken = _preview_share(directory, settings, tap)
                topic.append(preview + taken)
                taps.append(taken)
            log(f"topic {topic[-1]:.1f} % (tap {taken:.1f} %), shared memory {shared[-1]:.1f} % of a core")
    return [
        Row(
            name="video.ros_camera_cpu",
            what="CPU of tap and preview for a ROS camera, against the preview's for the same frames"
            " through shmsrc (720p30, NV12)",
            unit="% of a core",
            values=topic,
            references=shared,
            bar=_BAR,
        )
    ]


def _preview_share(
    directory: Path, settings: Mapping[str, Any], tap: RunningTap | None = None
) -> tuple[float, float]:
    """Returns the shares of a core that a running preview, and the tap, need, in percent."""
    with RunningPreview(directory, settings, small=False) as preview:
        preview.enable()
        preview.running(within_s=_WITHIN_S)
        preview.wait_for(lambda a: a.measurement.fps > 0.9 * FPS, "all frames", _WITHIN_S)
        cpu_share(preview.process.pid, SETTLE_S)
        taken = cpu_share(tap.process.pid, WINDOW_S).whole if tap else 0.0
        share = cpu_share(preview.process.pid, WINDOW_S).whole
        preview.wait_for(lambda a: a.measurement.fps > 0.9 * FPS, "all frames still", _WITHIN_S)
        return share, taken


@contextmanager
def _directory() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as directory:
        yield Path(directory)


@contextmanager
def _publishing(footage: Path) -> Iterator[None]:
    command = [sys.executable, "-m", "bench.video.ros_camera_process", str(footage), TOPIC, str(FPS)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            if process.stdout.readline().strip() != "ready":
                raise RuntimeError("the camera's node did not begin")
            yield
        finally:
            foreign.end(process)
