"""The recorder's lowered priority, as the kernel has it for a real process and its threads."""

import json
import os
import subprocess
import sys
from typing import Any, Final

import pytest

NICE: Final = 10
BEST_EFFORT_LOWEST: Final = [2, 7]
"""IOPRIO_CLASS_BE and its last level (ioprio_set(2))."""
CHILD: Final = """
import json, os, sys, threading
import psutil
from recorder.priority import step_back

def priorities():
    ionice = psutil.Process(threading.get_native_id()).ionice()
    return {"nice": os.getpriority(os.PRIO_PROCESS, 0), "io": [int(ionice.ioclass), ionice.value]}

try:
    os.setpriority(os.PRIO_PROCESS, 0, int(sys.argv[1]))
except PermissionError:
    pass  # Only root may go back to a better one.
psutil.Process().ionice(psutil.IOPRIO_CLASS_BE, 0)
found = {"before": priorities()}
step_back()
found["after"] = priorities()
thread = threading.Thread(target=lambda: found.update(thread=priorities()))
thread.start()
thread.join()
print(json.dumps(found))
"""


def stepped_back(nice: int) -> dict[str, Any]:
    """What a process has before and after, and what a thread that it starts then has."""
    child = [sys.executable, "-c", CHILD, str(nice)]
    done = subprocess.run(child, capture_output=True, text=True, timeout=60, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.skipif(os.uname().machine not in ("x86_64", "aarch64"), reason="x86-64 or arm64")
@pytest.mark.parametrize("nice", [0, 5])
def test_a_process_and_the_threads_that_it_starts_step_back(nice: int) -> None:
    found = stepped_back(nice)
    lowered = {"nice": max(NICE, found["before"]["nice"]), "io": BEST_EFFORT_LOWEST}
    assert found["before"]["io"] != BEST_EFFORT_LOWEST, "it is not lowered already"
    assert found["after"] == lowered
    assert found["thread"] == lowered


def test_a_process_that_has_a_lower_priority_already_keeps_it() -> None:
    found = stepped_back(15)
    assert found["before"]["nice"] >= 15
    assert found["after"]["nice"] == found["before"]["nice"]
