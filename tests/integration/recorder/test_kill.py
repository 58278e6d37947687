"""Killed at random instants, a recorder loses at most a second, and says what it has lost.

RECORDER_KILLS=200 in the environment makes it many times.
"""

import itertools
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from recorder.recording.lifecycle import State
from recorder.store.manifest import RecordingState
from recorder.values import GapCause
from tests.support.promise import keeps_async
from tests.support.recorder_in_process import numbers, running_recorder
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[3]
_KILLS: Final = int(os.environ.get("RECORDER_KILLS", "10"))
_NS_PER_S: Final = 1_000_000_000
_LOST_AT_MOST_S: Final = 1.0


def killed(root: Path, first: int, after: int) -> dict[int, int]:
    """Kills a recorder when it was handed some messages; returns when it was handed each, in ns."""
    command = [sys.executable, "-m", "tests.support.recorder_child", str(root), str(first)]
    output = root / "child.txt"
    with output.open("wb") as file:
        child = subprocess.Popen(command, cwd=_ROOT, stdout=file)
    try:
        wait_until(lambda: output.read_bytes().count(b"\n") >= after, "messages are handed over", 60.0)
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()
    lines = [line.split() for line in output.read_text(encoding="ascii").splitlines(keepends=True)]
    return {int(words[0]): int(words[1]) for words in lines if len(words) == 2}


@pytest.mark.timed
@pytest.mark.timeout(60 + 20 * _KILLS)
async def test_what_is_missing_lies_in_a_gap_of_at_most_a_second_before_each_kill(tmp_path: Path) -> None:
    attempts = itertools.count(1)

    async def lost_s() -> float:
        root = tmp_path / f"attempt-{next(attempts)}"
        root.mkdir()
        return await longest_loss_s(root)

    await keeps_async(_LOST_AT_MOST_S, "how long before a kill what it has cost was handed over, s", lost_s)


async def longest_loss_s(root: Path) -> float:
    """Kills a recorder again and again; returns how long before a kill the oldest lost message came."""
    handed: dict[int, int] = {}
    kills_ns = []
    for _ in range(_KILLS):
        part = killed(root, len(handed) + 1, random.randint(1, 700))
        handed |= part
        kills_ns.append(max(part.values()))
    async with running_recorder(root) as running:
        await running.until(lambda: running.status_reader.phase.state is State.RECORDING)
        done = (await running.operations.stop("stop", "")).recording
        assert done
        found = numbers(running.status_reader, done)
    assert done.state is RecordingState.COMPLETE
    assert found == sorted(set(found)), "in order, and each once"
    gaps = [gap for gap in done.all_gaps if gap.cause is GapCause.INTERRUPTED]
    assert len(gaps) >= _KILLS
    missing = handed.keys() - set(found)
    losses_ns = [0]
    for number in missing:
        at_ns = handed[number]
        assert any(gap.began_ns <= at_ns <= gap.ended_ns for gap in gaps), f"{number} is missing silently"
        losses_ns.append(min(kill_ns - at_ns for kill_ns in kills_ns if kill_ns >= at_ns))
    lost = f"{len(missing)} of {len(handed)} messages, none more than {max(losses_ns) / 1e6:.0f} ms before"
    print(f"lost by {_KILLS} kills: {lost}")
    return max(losses_ns) / _NS_PER_S
