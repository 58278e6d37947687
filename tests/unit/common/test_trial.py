"""What becomes of a trial whose child fails in each way, and how long that may take."""

import asyncio
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from common import trial
from tests.support.processes import has_ended
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[3]
CHILD = "tests.support.trial_child"


async def outcome(*arguments: str, timeout_s: float = 20) -> str:
    with pytest.raises(trial.TrialError) as failure:
        await trial.run(timeout_s, CHILD, *arguments)
    return f"{failure.value}{'; passing' if failure.value.passing else ''}"


async def test_a_result_comes_back() -> None:
    assert await trial.run(20, CHILD, "report", "7") == {"error": "", "number": 7}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("error", "two\nlines"), "two lines"),
        (("user error", "no such element"), "no such element"),
        (("signal", str(int(signal.SIGSEGV))), "it crashed when tried (SIGSEGV)"),
        (("signal", str(int(signal.SIGKILL))), "it crashed when tried (SIGKILL); passing"),
        (("nonsense", "x"), "its trial ended with code 0 and without a result"),
        (("unknown", "x"), "its trial ended with code 1 and without a result"),
    ],
)
async def test_a_failure_says_why(arguments: tuple[str, ...], reason: str) -> None:
    assert await outcome(*arguments) == reason


@pytest.mark.parametrize(
    ("output", "code", "reason"),
    [
        (b"[" * 100_000, 0, "its trial ended with code 0 and without a result"),
        (b"", -(signal.SIGRTMIN + 1), f"it crashed when tried (signal {signal.SIGRTMIN + 1})"),
    ],
    ids=["nested too deeply", "a real-time signal"],
)
def test_what_no_child_of_ours_would_do(output: bytes, code: int, reason: str) -> None:
    with pytest.raises(trial.TrialError) as failure:
        trial.parse_result(output, code)
    assert str(failure.value) == reason


async def test_a_child_that_hangs_is_killed_at_its_deadline() -> None:
    assert await outcome("hang", "x", timeout_s=1) == "it hung: no result within 1 s; passing"


async def test_a_child_that_prints_without_end_is_killed() -> None:
    began_s = time.monotonic()
    assert await outcome("flood", "x") == "its trial printed more than 64 KiB"
    assert time.monotonic() - began_s < 10, "long before its deadline"


async def test_a_process_that_can_not_be_started_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/not/there")
    assert await outcome("report", "7") == "its trial can't be started: No such file or directory; passing"


async def test_a_child_that_can_not_be_killed_is_waited_for_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    held: list[int] = []
    begun = asyncio.Event()
    start = asyncio.create_subprocess_exec

    async def noted(*words: str, **options: Any) -> asyncio.subprocess.Process:
        child = await start(*words, **options)
        begun.set()
        return child

    with monkeypatch.context() as patched:
        patched.setattr(asyncio.subprocess.Process, "kill", lambda child: held.append(child.pid))
        started_s = time.monotonic()
        assert await outcome("hang", "one", timeout_s=1) == "it hung: no result within 1 s; passing"
        assert time.monotonic() - started_s < 5
        patched.setattr(asyncio, "create_subprocess_exec", noted)
        task = asyncio.create_task(trial.run(20, CHILD, "hang", "another"))
        # Cancelled while it starts a child, asyncio itself kills it.
        await begun.wait()
        started_s = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - started_s < 3
        # Each would be held by the same driver: a machine must not fill with them.
        for what in ("one", "another"):
            assert await outcome("hang", what) == "its last trial was killed and has not ended; passing"
    assert len(held) == 2, "no further one was started"
    assert await trial.run(20, CHILD, "report", "7") == {"error": "", "number": 7}, "others are"
    for pid in held:
        handle = os.pidfd_open(pid)
        os.kill(pid, signal.SIGKILL)
        await asyncio.to_thread(select.select, [handle], [], [], 10)
        os.close(handle)
    assert await outcome("hang", "one", timeout_s=1) == "it hung: no result within 1 s; passing"


def test_a_child_does_not_outlive_its_parent() -> None:
    code = f"import asyncio; from common import trial; asyncio.run(trial.run(60, {CHILD!r}, 'hang', 'x'))"
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT) as parent:
        (child,) = wait_until(lambda: psutil.Process(parent.pid).children(), "the child")
        parent.kill()
        parent.wait(10)
        wait_until(lambda: has_ended(child.pid), "it ended")
