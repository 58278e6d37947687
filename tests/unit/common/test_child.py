"""A helper process ends with the one that started it, even while it hangs with Python's lock held."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.processes import has_ended
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[3]
# PyDLL keeps Python's lock during the call: no handler or thread of Python runs, as in a driver that hangs.
HANGS = "import ctypes; ctypes.PyDLL(None).sleep(60)"
HELPER = f"""
import sys
from common.child import end_with_parent
end_with_parent(int(sys.argv[1]), {{}})
print("begun", flush=True)
{HANGS}
"""
PARENT = f"""
import os, subprocess, sys
helper = subprocess.Popen([sys.executable, "-c", {HELPER.format(60)!r}, str(os.getpid())])
print(helper.pid, flush=True)
helper.wait()
"""


def run(code: str, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_it_ends_with_its_parent(number: signal.Signals) -> None:
    with run(PARENT) as parent:
        assert parent.stdout
        lines = {parent.stdout.readline().strip(), parent.stdout.readline().strip()}
        assert "begun" in lines
        helper = int((lines - {"begun"}).pop())
        os.kill(parent.pid, number)
        parent.wait(10)
        wait_until(lambda: has_ended(helper), "it ended")


def test_it_ends_after_its_time() -> None:
    with run(HELPER.format(1), str(os.getpid())) as helper:
        assert helper.wait(15) == -signal.SIGALRM


def test_it_does_not_begin_without_its_parent() -> None:
    """A parent that was killed while Python started: this process has another one by then."""
    gone = run("")
    gone.communicate()
    with run(HELPER.format(60), str(gone.pid)) as helper:
        assert helper.wait(15) == os.EX_UNAVAILABLE
