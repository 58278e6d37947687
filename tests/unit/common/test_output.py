"""A program in an ASCII locale prints what it can."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_character_that_the_encoding_lacks_ends_nothing(stream: str) -> None:
    code = f"""
import sys
from common.output import tolerate_encoding
tolerate_encoding()
print("85 \\N{{DEGREE SIGN}}C", file=sys.{stream})
"""
    ran = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONIOENCODING": "ascii:strict", "PYTHONPATH": "."},
    )
    assert getattr(ran, stream) == "85 ?C\n"
