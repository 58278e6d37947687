"""On a machine without ROS the intake says so, with what to do."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
PROGRAM = """
import sys
sys.modules["rclpy"] = None
from common.errors import UserError
try:
    import recorder.intake.intake
except UserError as error:
    print(error)
"""


def test_the_error_names_the_remedy() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert ran.stdout.startswith("ROS 2 can't be used from Python")
    assert "scripts/setup" in ran.stdout
