"""A program in an ASCII locale prints what it can."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_character_that_the_encoding_lacks_ends_no_program(stream: str) -> None:
    """As all programs are run but robotctl, which tests/integration/console/test_ascii.py has."""
    code = f"""
import sys
from common.program import run_to_exit
run_to_exit(lambda: print("85 \\N{{DEGREE SIGN}}C", file=sys.{stream}))
"""
    ran = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONIOENCODING": "ascii:strict", "PYTHONPATH": "."},
    )
    assert getattr(ran, stream) == "85 ?C\n"
