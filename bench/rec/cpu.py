"""CPU of robot-recorder: against an rclpy node that records the same, in turns; at rest; with the ring alone.

The figures are of whole processes, Fast DDS included, for each message that was written in a window, so that
a side that loses messages gains nothing by it.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.processes import cpu_seconds, cpu_share, program
from bench.progress import log
from bench.rec.ground import PRESET, taking_from, talker
from bench.rec.talker import IMAGE_HZ, ODOMETRIES, ODOMETRY_HZ
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.running_recorder import RecorderProgram, recorder_program
from tests.support.waiting import wait_until

ROUNDS: Final = FEWEST_ROUNDS
WINDOW_S: Final = 10.0
RATE_MB_S: Final = 10
SETTLE_S: Final = 3.0
LEAST_SHARE: Final = 0.9
"""Of the messages that the talker is to publish: a side that gets fewer records something else."""
_TYPES: Final = {"odometry": "nav_msgs/msg/Odometry", "image": "sensor_msgs/msg/CompressedImage"}
_MESSAGES_HZ: Final = ODOMETRIES * ODOMETRY_HZ + IMAGE_HZ


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one window."""

    us_per_message: float
    percent: float
    """Of a core."""
    messages_hz: float


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    made = []
    if wanted & {"rec.cpu", "rec.idle_cpu"}:
        with recorder_program(workdir, presets=PRESET) as recorder, talker(RATE_MB_S):
            if "rec.idle_cpu" in wanted:
                made.append(_idle(recorder))
            if "rec.cpu" in wanted:
                made.append(_recording(recorder, workdir))
    if "rec.ring_cpu" in wanted:
        ring = {"preset": "all", "seconds": 30}
        with recorder_program(workdir, presets=PRESET, ring=ring) as recorder, talker(RATE_MB_S):
            made.append(_ring(recorder))
    return made


def ours(recorder: RecorderProgram, window_s: float) -> Cost:
    """Measures the recorder while it records."""
    assert recorder.process
    with taking_from(recorder):
        time.sleep(SETTLE_S)
        return _cost(recorder.process.pid, lambda: _flushed(recorder), window_s)


def reference(workdir: Path, window_s: float) -> Cost:
    """Measures a node whose callbacks write."""
    names = [f"/bench/odometry_{number}" for number in range(ODOMETRIES)]
    names += [f"/bench/image_{number}" for number in range(RATE_MB_S // 10)]
    topics = [f"{name}:{_TYPES[name.split('/')[2].split('_')[0]]}" for name in names]
    file = workdir / "callbacks.mcap"
    with program("bench.rec.callbacks", str(file), *topics) as process:

        def written() -> int:
            assert process.stdin
            assert process.stdout
            process.stdin.write("\n")
            process.stdin.flush()
            return int(process.stdout.readline())

        time.sleep(SETTLE_S)
        cost = _cost(process.pid, written, window_s)
    file.unlink()
    return cost


def _recording(recorder: RecorderProgram, workdir: Path) -> Row:
    recorded, called_back = [], []
    for number in range(ROUNDS):
        recorded.append(ours(recorder, WINDOW_S))
        called_back.append(reference(workdir, WINDOW_S))
        log(f"rec.cpu: round {number + 1}, {recorded[-1]}, callbacks {called_back[-1]}")
        least_hz = min(recorded[-1].messages_hz, called_back[-1].messages_hz)
        if least_hz < LEAST_SHARE * _MESSAGES_HZ:
            raise RuntimeError(f"only {least_hz:.0f} messages a second were written: the machine is too busy")
    return Row(
        name="rec.cpu",
        what=f"CPU for each message recorded at {RATE_MB_S} MB/s, against an rclpy executor whose callbacks"
        " get messages as objects and write the same MCAP, in turns",
        unit="us",
        values=[each.us_per_message for each in recorded],
        references=[each.us_per_message for each in called_back],
        bar=0.4,
    )


def _idle(recorder: RecorderProgram) -> Row:
    return Row(
        name="rec.idle_cpu",
        what=f"CPU of robot-recorder without ring and recording, beside {RATE_MB_S} MB/s",
        unit="% of a core",
        values=_percents(recorder, "rec.idle_cpu"),
        bar=1,
    )


def _ring(recorder: RecorderProgram) -> Row:
    return Row(
        name="rec.ring_cpu",
        what=f"CPU of robot-recorder with the ring alone, at {RATE_MB_S} MB/s",
        unit="% of a core",
        values=_percents(recorder, "rec.ring_cpu"),
        bar=None,
    )


def _percents(recorder: RecorderProgram, name: str) -> list[float]:
    assert recorder.process
    time.sleep(SETTLE_S)
    percents = []
    for _ in range(ROUNDS):
        share = cpu_share(recorder.process.pid, WINDOW_S)
        percents.append(share.whole)
        log(f"{name}: {share.own:.2f} % + {share.middleware:.2f} % in Fast DDS")
    return percents


def _flushed(recorder: RecorderProgram) -> int:
    """Returns how many messages are written, right after a flush: the count changes only then."""
    before = recorder.state.status.messages_written
    return wait_until(
        lambda: count if (count := recorder.state.status.messages_written) != before else None,
        "the recorder flushes",
    )


def _cost(pid: int, written: Callable[[], int], window_s: float) -> Cost:
    """Returns the cost of the coming window."""
    messages, cpu_s, began_s = written(), cpu_seconds(pid), time.monotonic()
    time.sleep(window_s)
    messages, cpu_s, passed_s = written() - messages, cpu_seconds(pid) - cpu_s, time.monotonic() - began_s
    return Cost(cpu_s / messages * 1e6, cpu_s / passed_s * 100, messages / passed_s)
