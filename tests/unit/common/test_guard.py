"""The guard, with small programs: what it passes on, and when it kills."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from common.guard import EXIT_SILENT
from tests.support.processes import has_ended
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[3]
BEATS = """
import asyncio, faulthandler, os
from common import program
faulthandler.enable()
async def main(stop):
    print(os.getpid(), flush=True)
    {}
    await stop.wait()
program.run(main)
"""
HANGS = "__import__('ctypes').PyDLL(None).sleep(60)"


def guarded(program: str, start_s: int = 60, silence_s: int = 1) -> "subprocess.Popen[str]":
    """Starts a guard of a Python program."""
    code = f"""
import sys
from common.guard import guard
sys.exit(guard([sys.executable, "-c", {program!r}], {start_s}, {silence_s}))
"""
    return subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def first_line(guard: "subprocess.Popen[str]") -> int:
    assert guard.stdout
    return int(guard.stdout.readline())


@pytest.mark.parametrize(("ends", "code"), [("", 0), ("raise SystemExit(3)", 3), ("os.abort()", 134)])
def test_the_exit_code_is_that_of_the_program(ends: str, code: int) -> None:
    with guarded(f"import os; {ends}") as guard:
        assert guard.wait(20) == code


def test_what_a_killed_program_leaves_behind_may_finish() -> None:
    """In a container, its first process ends with the guard, and everything else with that."""
    child = "import time; time.sleep(0.5); print('last words', flush=True)"
    program = (
        "import os, subprocess, sys;"
        f"subprocess.Popen([sys.executable, '-c', {child!r}]);"
        "print(os.getpid(), flush=True);"
        "os.kill(os.getpid(), 9)"
    )
    with guarded(program) as guard:
        first_line(guard)
        assert guard.wait(20) == 137
        assert guard.stdout
        os.set_blocking(guard.stdout.fileno(), False)
        assert guard.stdout.read() == "last words\n"


def test_a_program_that_sends_heartbeats_lives_until_it_is_asked_to_end() -> None:
    with guarded(BEATS.format("")) as guard:
        first_line(guard)
        with pytest.raises(subprocess.TimeoutExpired):
            guard.wait(4)
        guard.send_signal(signal.SIGTERM)
        assert guard.wait(10) == 0


@pytest.mark.parametrize("freeze", ["SIGSTOP", "native code", "at the end"])
def test_a_program_that_falls_silent_is_killed(freeze: str) -> None:
    program = BEATS.format(HANGS if freeze == "native code" else "")
    with guarded(program + (HANGS if freeze == "at the end" else "")) as guard:
        child = first_line(guard)
        if freeze == "SIGSTOP":
            os.kill(child, signal.SIGSTOP)
        elif freeze == "at the end":
            guard.send_signal(signal.SIGTERM)
        assert guard.wait(10) == EXIT_SILENT
        assert guard.stderr
        said = guard.stderr.read()
        assert "no heartbeat for 1 s, killed" in said
        assert ("Fatal Python error: Aborted" in said) is (freeze != "SIGSTOP")
        assert has_ended(child)


def test_a_program_that_never_begins_is_killed() -> None:
    with guarded("import time; time.sleep(60)", start_s=1) as guard:
        assert guard.wait(10) == EXIT_SILENT


def test_frozen_together_with_its_program_it_waits_again() -> None:
    """As when a container is paused: no heartbeat came, but none could have come."""
    with guarded(BEATS.format("")) as guard:
        child = psutil.Process(first_line(guard))
        guard.send_signal(signal.SIGSTOP)
        child.suspend()
        with pytest.raises(subprocess.TimeoutExpired):
            guard.wait(3)
        child.resume()
        guard.send_signal(signal.SIGCONT)
        with pytest.raises(subprocess.TimeoutExpired):
            guard.wait(2)
        guard.terminate()
        assert guard.wait(10) == 0


def test_a_killed_guard_leaves_no_program_behind() -> None:
    with guarded(BEATS.format("")) as guard:
        child = first_line(guard)
        guard.kill()
        guard.wait(10)
        wait_until(lambda: has_ended(child), "it ended")


def test_a_program_that_does_not_exist_is_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "common.guard", "/not/there"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    assert (done.returncode, done.stderr) == (
        1,
        "error: /not/there can't be started: No such file or directory\n",
    )
