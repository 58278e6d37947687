"""A window that is open all day does not use up Python's None."""

import subprocess
import sys
from pathlib import Path

CALLS = 100_000
PROGRAM = f"""
import sys
import console.window
from PySide6.QtCore import QObject
thing = QObject()
for number in range({CALLS}):
    thing.setObjectName("x")
print(sys.getrefcount(None) > 100)
"""


def test_none_outlives_a_hundred_thousand_calls_of_qt() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.strip() == "True"
