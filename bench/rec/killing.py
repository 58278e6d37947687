"""What a recorder that is killed (kill -9) at a random instant loses: the time before it that no file has."""

import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rec.ground import PRESET, begun, talker
from bench.rec.reading import newest_ns
from bench.ros_domain import ros_domain
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.running_recorder import recorder_program

ROUNDS: Final = 2 * FEWEST_ROUNDS
RATE_MB_S: Final = 10
BAR_MS: Final = 1000
_SPREAD_S: Final = 2.0
_PROGRAM: Final = Path(sys.executable).parent / "robot-recorder"
_RECOVER_WITHIN_S: Final = 60


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    lost_ms = []
    for seed in range(ROUNDS):
        directory = workdir / f"kill{seed}"
        directory.mkdir()
        # Each in a domain of its own: DDS takes a killed participant for alive until its lease has expired.
        with ros_domain(), talker(RATE_MB_S):
            lost_ms.append(one_kill(directory, random.Random(seed).uniform(0, _SPREAD_S)))  # repeatable
        log(f"rec.kill_loss_ms: round {seed + 1}, {lost_ms[-1]:.0f} ms lost")
    return [
        Row(
            name="rec.kill_loss_ms",
            what=f"recorder killed at a random instant at {RATE_MB_S} MB/s: time before it that is missing"
            " after robot-recorder recover",
            unit="ms",
            values=lost_ms,
            bar=BAR_MS,
            judged="worst",
        )
    ]


def one_kill(directory: Path, after_s: float) -> float:
    """Kills a recorder so long after it has begun to write; returns what is lost, in ms.

    Raises:
        RuntimeError: nothing was recovered.
    """
    with recorder_program(directory, presets=PRESET) as recorder:
        running = begun(recorder)
        running.wait_until_written(1)
        time.sleep(after_s)
        killed_ns = time.time_ns()
        recorder.kill()
        command = [str(_PROGRAM), "recover", str(recorder.root)]
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True, timeout=_RECOVER_WITHIN_S)
        newest = newest_ns(running.folder)
    if not newest:
        raise RuntimeError("nothing was recovered")
    return (killed_ns - newest) / 1e6
