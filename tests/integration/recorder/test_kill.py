"""Killed at random instants, a recorder loses at most a second, and says what it has lost.

RECORDER_KILLS=200 in the environment makes it many times.
"""

import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from recorder.lifecycle import State
from recorder.store.manifest import RecordingState
from recorder.values import GapCause
from tests.support.recorder_in_process import numbers, running_recorder
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[3]
_KILLS: Final = int(os.environ.get("RECORDER_KILLS", "10"))
_NS_PER_S: Final = 1_000_000_000


def killed(root: Path, first: int, after: int) -> dict[int, int]:
    """Kills a recorder when it was handed some messages; returns when it was handed each, in ns."""
    command = [sys.executable, "-m", "tests.support.recorder_child", str(root), str(first)]
    output = root / "child.txt"
    with output.open("wb") as file:
        child = subprocess.Popen(command, cwd=_ROOT, stdout=file)
    try:
        wait_until(lambda: output.read_bytes().count(b"\n") >= after, "messages are handed over")
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()
    lines = [line.split() for line in output.read_text(encoding="ascii").splitlines(keepends=True)]
    return {int(words[0]): int(words[1]) for words in lines if len(words) == 2}


@pytest.mark.timeout(60 + 20 * _KILLS)
async def test_what_is_missing_lies_in_a_gap_of_at_most_a_second_before_each_kill(tmp_path: Path) -> None:
    handed: dict[int, int] = {}
    kills_ns = []
    for _ in range(_KILLS):
        part = killed(tmp_path, len(handed) + 1, random.randint(1, 700))
        handed |= part
        kills_ns.append(max(part.values()))
    async with running_recorder(tmp_path) as running:
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
        assert losses_ns[-1] <= _NS_PER_S, f"{number} was lost too early"
    lost = f"{len(missing)} of {len(handed)} messages, none more than {max(losses_ns) / 1e6:.0f} ms before"
    print(f"lost by {_KILLS} kills: {lost}")
