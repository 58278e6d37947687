"""Video in recordings: what it costs the preview, and how true its stamps are.

A camera draws the time of capture into each frame. The preview sends it to a viewer, and hands the encoder's
output to robot-recorder.
"""

import statistics
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.processes import cpu_seconds
from bench.progress import log
from bench.rec.ground import PRESET, Taking, taking
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.viewing import watch, watch_window
from recorder.mcap.reading import messages
from recorder.values import VIDEO_TOPIC
from recorder.video.message import decode
from tests.support.judges import stamps
from tests.support.running_recorder import RecorderProgram, recorder_program

ROUNDS: Final = FEWEST_ROUNDS
WINDOW_S: Final = 8.0
FPS: Final = 30
LATENCY_MS: Final = 125
SETTLE_S: Final = 2.0
LEAST_READ: Final = 0.9
"""Of the frames of a recording: so many must have a stamp that can be read."""


@dataclass(frozen=True, slots=True)
class Ground:
    """Camera, preview with its gateway, and recorder, all running."""

    directory: Path
    source: Camera
    robot: product.Robot
    recorder: RecorderProgram


@contextmanager
def video_ground(workdir: Path) -> Iterator[Ground]:
    """Runs all of them until the block ends."""
    tap = str(workdir / "tap.sock")
    with (
        camera(workdir, FPS) as source,
        product.robot(workdir, source, LATENCY_MS, settings={"video_tap": {"socket": tap}}) as robot,
        recorder_program(workdir, presets=PRESET, video={"socket": tap}) as recorder,
    ):
        yield Ground(workdir, source, robot, recorder)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    made = []
    with video_ground(workdir) as ground:
        if "rec.preview_tap" in wanted:
            made.append(_tap(ground))
        if wanted & {"rec.stamps", "rec.stamps_worst"}:
            made += _stamps(ground)
    return [row for row in made if row.name in wanted]


def _tap(ground: Ground) -> Row:
    recorded, alone = [], []
    with ground.robot.preview():
        for number in range(ROUNDS):
            alone.append(ms_per_frame(ground, WINDOW_S, recording=False))
            recorded.append(ms_per_frame(ground, WINDOW_S, recording=True))
            log(f"rec.preview_tap: round {number + 1}, {recorded[-1]:.2f} ms against {alone[-1]:.2f} ms")
    return Row(
        name="rec.preview_tap",
        what="CPU of the preview service for each frame that its viewer gets, while it is recorded, against"
        " without a recording, in turns",
        unit="ms",
        values=recorded,
        references=alone,
        bar=1.1,
    )


def _stamps(ground: Ground) -> list[Row]:
    medians, worst = [], []
    for number in range(ROUNDS):
        found = [error_ms * FPS / 1000 for error_ms in stamp_errors_ms(ground, WINDOW_S)]
        medians.append(statistics.median(found))
        worst.append(max(found))
        log(
            f"rec.stamps: round {number + 1}, {len(found)} frames, median {medians[-1]:.2f} frames off,"
            f" {min(found):.2f} to {worst[-1]:.2f}"
        )
    what = "stamps of the recorded video against the time of capture that is drawn into the frames"
    return [
        Row(
            name="rec.stamps",
            what=f"{what}: median of the differences, without their signs",
            unit="frames",
            values=medians,
            bar=1,
            judged="worst",
        ),
        Row(
            name="rec.stamps_worst",
            what=f"{what}: the frame that is off most",
            unit="frames",
            values=worst,
            bar=1,
            judged="worst",
        ),
    ]


def ms_per_frame(ground: Ground, window_s: float, *, recording: bool) -> float:
    """Returns the CPU time of the preview service for each frame that reaches a viewer, in ms."""
    with ExitStack() as stack:
        viewer = stack.enter_context(ground.robot.viewer())
        if recording:
            running = stack.enter_context(taking(ground.recorder, with_video=True))
            running.wait_until_written(1)
        watch(viewer, SETTLE_S)
        with ThreadPoolExecutor(1) as meter:
            spent_s = meter.submit(_cpu_s, ground.robot.service.pid, window_s)
            frames = len(watch_window(viewer, window_s).glances)
        return spent_s.result() * 1000 / frames


def stamp_errors_ms(ground: Ground, seconds: float) -> list[float]:
    """Records for so long without a viewer; returns the error of each frame's stamp, without its sign.

    Raises:
        RuntimeError: not every frame is decoded, or of too many the drawn time can't be read.
    """
    with taking(ground.recorder, with_video=True) as running:
        running.wait_until_written(1)
        time.sleep(seconds)
        offset_ns = time.time_ns() - time.monotonic_ns()
        running.stop()
        frames, film = _frames(running, ground.directory)
        drawn_s = stamps(film)
    if len(drawn_s) != len(frames):
        raise RuntimeError(f"{len(frames)} frames are recorded, {len(drawn_s)} are decoded")
    errors = [
        abs((captured_ns - offset_ns) / 1e6 - at_s * 1000)
        for captured_ns, at_s in zip(frames, drawn_s, strict=True)
        if at_s is not None
    ]
    if len(errors) < max(LEAST_READ * len(frames), FPS):
        raise RuntimeError(f"the drawn time of only {len(errors)} of {len(frames)} frames can be read")
    return errors


def _frames(running: Taking, directory: Path) -> tuple[list[int], Path]:
    """Returns the stamps of a recording's frames, in calendar ns, and a file with their access units."""
    found = [
        frame
        for path in sorted(running.folder.glob("data/*.mcap"))
        for _, data in messages(path, VIDEO_TOPIC)
        if (frame := decode(data))
    ]
    film = directory / f"film.{found[0].codec if found else 'h264'}"
    film.write_bytes(b"".join(each.unit for each in found))
    return [each.captured_ns for each in found], film


def _cpu_s(pid: int, window_s: float) -> float:
    before_s = cpu_seconds(pid)
    time.sleep(window_s)
    return cpu_seconds(pid) - before_s
