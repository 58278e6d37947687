"""What a process learns from the marker and the crash report of the previous one."""

import json
import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from preview.encoders.crash_marker import LAST_REPORT, CrashMarkerFile

# A process of its own each time: the fault handler of the test's process is pytest's.
LIVES = """
import os, sys
from pathlib import Path
from preview.encoders.crash_marker import CrashMarkerFile
marker = CrashMarkerFile(Path(sys.argv[1]))
class Selection:
    def pass_over(self, name, reason): print(reason, end="; ")
    def trust(self, names): print(*sorted(names))
if sys.argv[3:]:
    marker.blame_previous(Selection())
    marker.set(sys.argv[3], proven=sys.argv[4:])
else:
    print(marker.begin_report(), flush=True)
sys.stdout.flush()
os.kill(os.getpid(), int(sys.argv[2]))
"""
ROOT = Path(__file__).parents[4]


def life(directory: Path, *uses: str, ends_by: signal.Signals = signal.SIGTERM) -> str:
    """Runs a process until it ends by a signal; returns what it learned of the previous one.

    Args:
        directory: runtime directory.
        uses: encoder that it uses, and the proven ones; none: only the crash report is read.
        ends_by: signal.
    """
    process = subprocess.run(
        [sys.executable, "-c", LIVES, directory, str(int(ends_by)), *uses],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        timeout=30,
        check=False,
    )
    assert process.returncode == -ends_by
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
    assert life(directory, ends_by=number) == ""
    assert life(directory) == cause


def test_a_report_counts_once(tmp_path: Path) -> None:
    life(tmp_path, ends_by=signal.SIGSEGV)
    assert life(tmp_path)
    assert life(tmp_path) == ""


def test_a_report_is_kept_for_people_until_the_next_crash(tmp_path: Path) -> None:
    life(tmp_path, ends_by=signal.SIGSEGV)
    for _ in range(2):
        life(tmp_path)
        assert (tmp_path / LAST_REPORT).read_text(encoding="utf-8").startswith("Fatal Python error: Segm")
    life(tmp_path, ends_by=signal.SIGABRT)
    life(tmp_path)
    assert (tmp_path / LAST_REPORT).read_text(encoding="utf-8").startswith("Fatal Python error: Aborted")


def test_a_directory_of_others_is_neither_read_nor_written(tmp_path: Path) -> None:
    """Where all users may write, another one could have made it, or a link to a directory of this user."""
    own = tmp_path / "own"
    CrashMarkerFile(own).set("mpp-h265", "it hung when it was stopped")
    (tmp_path / "link").symlink_to(own)
    shared = tmp_path / "shared"
    shared.mkdir()
    shutil.copy(own / "encoder-in-use.json", shared)
    shared.chmod(0o1777)
    for directory in (tmp_path / "link", shared):
        before = sorted(directory.iterdir())
        assert life(directory, "x264") == ""
        assert sorted(directory.iterdir()) == before
        assert json.loads((directory / "encoder-in-use.json").read_text())["encoder"] == "mpp-h265"


def test_the_directory_is_closed_to_others(tmp_path: Path) -> None:
    directory = tmp_path / "run"
    directory.mkdir(mode=0o755)
    CrashMarkerFile(directory).set("mpp-h265")
    assert stat.S_IMODE(directory.stat().st_mode) == 0o700


def test_a_directory_that_cannot_be_made_is_survived(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert life(tmp_path / "file") == ""
    CrashMarkerFile(tmp_path / "file").set("mpp-h265")
    CrashMarkerFile(tmp_path / "file").clear()


def test_an_encoder_in_use_is_blamed_for_a_crash_and_not_for_a_kill(tmp_path: Path) -> None:
    assert life(tmp_path, "mpp-h265", ends_by=signal.SIGSEGV) == ""
    assert life(tmp_path, "va-h265", ends_by=signal.SIGKILL) == (
        "encoder mpp-h265 is passed over: the process crashed while it was in use (Segmentation fault);"
    )
    assert life(tmp_path, "x264") == ""


@pytest.mark.parametrize(
    ("ends_by", "trusted"), [(signal.SIGSEGV, "x264"), (signal.SIGKILL, "mpp-h265 x264")]
)
def test_what_was_proven_is_trusted_except_what_is_blamed(
    tmp_path: Path, ends_by: signal.Signals, trusted: str
) -> None:
    life(tmp_path, "mpp-h265", "mpp-h265", "x264", ends_by=ends_by)
    assert life(tmp_path, "x264").rpartition("; ")[2] == trusted


def test_an_encoder_that_hung_is_blamed_without_a_crash(tmp_path: Path) -> None:
    CrashMarkerFile(tmp_path).set("mpp-h265", "it hung when it was stopped")
    assert life(tmp_path, "x264") == "encoder mpp-h265 is passed over: it hung when it was stopped;"


def test_a_cleared_marker_blames_no_encoder(tmp_path: Path) -> None:
    marker = CrashMarkerFile(tmp_path)
    marker.set("mpp-h265")
    marker.clear()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["", "[]", '{"encoder": "mpp-h265"}', "\0"])
def test_a_damaged_marker_is_ignored(tmp_path: Path, content: str) -> None:
    (tmp_path / "encoder-in-use.json").write_text(content, encoding="utf-8")
    assert life(tmp_path, "x264") == ""


def test_two_services_do_not_blame_each_others_encoders(tmp_path: Path) -> None:
    first = CrashMarkerFile(tmp_path)
    first.set("mpp-h265", "it hung when it was stopped")
    assert life(tmp_path, "x264") == ""
    assert json.loads((tmp_path / "encoder-in-use.json").read_text(encoding="utf-8"))["encoder"] == "mpp-h265"
    del first
    assert life(tmp_path, "x264").startswith("encoder mpp-h265 is passed over")
