"""A process that writes a segment is killed: what is left of it, and how much is missing."""

import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

import pytest

from recorder.mcap.recovery import recover
from tests.support.promise import MS, keeps
from tests.support.segments import linear_log_times
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[3]
PROGRAM = """
import itertools, sys, time
from pathlib import Path
from recorder.mcap.writer import SegmentWriter
from recorder.values import Sample
from tests.support.segments import STRING, string_cdr

writer = SegmentWriter(Path(sys.argv[1]))
flush_at_s = time.monotonic() + 0.5
for number in itertools.count(1):
    now_ns = time.time_ns()
    writer.write(Sample(STRING, string_cdr("x" * 500), now_ns, now_ns, number, time.monotonic_ns()))
    if time.monotonic() >= flush_at_s:
        writer.flush()
        flush_at_s += 0.5
    time.sleep(0.001)
"""


@pytest.mark.timed
def test_a_killed_writer_loses_at_most_a_second(tmp_path: Path) -> None:
    losses_ms = [
        keeps(1000, "lost by a kill, ms", partial(lost_ms, tmp_path, lived_s), per_stalled_s=MS)
        for lived_s in (1.03, 1.25, 1.49)
    ]
    print(f"lost by kill -9: {', '.join(f'{each:.0f}' for each in losses_ms)} ms")


def lost_ms(directory: Path, lived_s: float) -> float:
    """Kills a writer that has lived for so long; returns how old the newest message is that it leaves."""
    part = Path(mkdtemp(dir=directory)) / "000000.mcap.part"
    with subprocess.Popen([sys.executable, "-c", PROGRAM, str(part)], cwd=ROOT) as writer:
        wait_until(part.exists, "a segment")
        threading.Event().wait(lived_s)
        writer.send_signal(signal.SIGKILL)
        killed_ns = time.time_ns()
    summary = recover(part)
    assert summary
    assert summary.last_ns
    assert len(linear_log_times(summary.path)) == summary.messages
    return (killed_ns - summary.last_ns) / 1e6
