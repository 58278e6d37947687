"""The reaper says why it can't start."""

import pytest

from tests.support.reaper import start_reaper

NO_PROCESS = 2**22 + 1
"""Beyond the largest number of a process (PID_MAX_LIMIT of Linux)."""


def test_a_refused_pidfd_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: an exit status alone, of a program whose words went to /dev/null."""
    monkeypatch.setattr("tests.support.reaper.os.getpid", lambda: NO_PROCESS)
    with pytest.raises(RuntimeError, match=rf"pidfd_open\({NO_PROCESS}\) is refused: No such process"):
        start_reaper("ROBOT_TEST_OF_THE_REAPER", "none")
