"""What keeps the system from delaying the drive program, as the kernel has it."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from tests.support.driving import Driving

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(os.geteuid() != 0, reason="needs the right to real-time priority and locked memory"),
]


def processes(robot: Driving) -> Iterator[psutil.Process]:
    robot.ready()
    assert robot.guard
    yield psutil.Process(robot.guard.pid)
    yield robot.worker


def test_guard_and_worker_have_real_time_priority(robot: Driving) -> None:
    priorities = []
    for process in processes(robot):
        assert os.sched_getscheduler(process.pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        priorities.append(os.sched_getparam(process.pid).sched_priority)
    guard, worker = priorities
    assert guard > worker, "it has to end the worker"


def test_all_code_is_in_memory_and_stays_there(robot: Driving) -> None:
    for process in processes(robot):
        mappings = Path(f"/proc/{process.pid}/smaps").read_text()
        code = re.findall(r"^\S+ r-xp \S+ \S+ \d+ +/\S.*\n((?:\w+: .*\n)+)", mappings, re.MULTILINE)
        assert len(code) > 10, "Python, Fast DDS, ..."
        for each in code:
            entry = dict(line.split(":", 1) for line in each.splitlines())
            assert entry["Rss"].strip() == entry["Size"].strip()
            assert "lo" in entry["VmFlags"].split(), "locked"


def test_without_the_right_to_it_the_program_runs_and_says_so() -> None:
    script = (
        "import logging, os, resource\n"
        "from drive.processes.real_time import lock_memory\n"
        "logging.basicConfig(level=logging.INFO)\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))\n"
        "os.setuid(65534)\n"
        "lock_memory()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "memory is not locked: " in done.stderr
