"""What the next process learns of the last one's end."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

# A process of its own each time: the fault handler of the test's process is pytest's.
LIVES = """
import os, sys
from pathlib import Path
from preview.encoders.crash_report import CrashReport
print(CrashReport(Path(sys.argv[1])).begin(), flush=True)
os.kill(os.getpid(), int(sys.argv[2]))
"""
ROOT = Path(__file__).parents[3]


def told_at_start(directory: Path, *, then_dies_of: signal.Signals = signal.SIGTERM) -> str:
    """What a process learns of the one before."""
    process = subprocess.run(
        [sys.executable, "-c", LIVES, directory, str(int(then_dies_of))],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        timeout=30,
        check=False,
    )
    assert process.returncode == -then_dies_of
    return process.stdout.strip()


@pytest.mark.parametrize(
    ("number", "cause"),
    [
        (signal.SIGSEGV, "Segmentation fault"),
        (signal.SIGABRT, "Aborted"),
        (signal.SIGBUS, "Bus error"),
        (signal.SIGKILL, ""),
        (signal.SIGTERM, ""),
    ],
)
def test_only_a_crash_leaves_a_report(tmp_path: Path, number: signal.Signals, cause: str) -> None:
    directory = tmp_path / "not" / "there"
    assert told_at_start(directory, then_dies_of=number) == ""
    assert told_at_start(directory) == cause


def test_a_report_counts_once(tmp_path: Path) -> None:
    told_at_start(tmp_path, then_dies_of=signal.SIGSEGV)
    assert told_at_start(tmp_path)
    assert told_at_start(tmp_path) == ""


def test_a_directory_that_cannot_be_made_is_survived(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert told_at_start(tmp_path / "file") == ""
