"""Watchers are woken by changes, and by nothing else."""

from collections.abc import Callable
from pathlib import Path

from recorder.recording.requests import StartOptions
from tests.support.recorder_in_process import Running, Source, running_recorder

IDLE_S = 0.8
"""The recorder looks at itself once or twice meanwhile."""
WITHIN_S = 15.0
"""That nothing comes is seen after a while; what is to come may come late on a busy machine."""


async def woken(running: Running, change: Callable[[], object] | None = None) -> bool:
    """Whether a change is notified; without one, whether anything is within a while."""
    changed = -1  # The first time is the question itself.

    def count() -> bool:
        nonlocal changed
        changed += 1
        if not changed and change:
            change()
        return changed > 0

    return await running.status_reader.changes.wait_until(count, WITHIN_S if change else IDLE_S)


async def falls_silent(running: Running) -> bool:
    """Whether notifications end: what was changed before may be notified once more."""
    for _ in range(3):
        if not await woken(running):
            return True
    return False


async def test_an_idle_recorder_notifies_no_one(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        assert await falls_silent(running)
        await running.operations.start("1", StartOptions())
        await running.operations.stop("2", "")
        assert await falls_silent(running)
        assert await woken(running, lambda: setattr(running.sources, "problem", "no video"))
        assert await falls_silent(running)


async def test_a_ring_without_messages_notifies_no_one_and_with_them_it_does(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        assert await falls_silent(running)
        assert await woken(running, Source(running.queue).send)
