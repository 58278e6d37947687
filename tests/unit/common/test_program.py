"""Programs run with as many descriptors as they may have."""

import subprocess
import sys

PROGRAM = """
import asyncio, resource
from common.program import run

async def main(stop: asyncio.Event) -> None:
    print(*resource.getrlimit(resource.RLIMIT_NOFILE))

resource.setrlimit(resource.RLIMIT_NOFILE, (128, 512))
run(main)
"""


def test_the_soft_limit_of_descriptors_is_raised_to_the_hard_one() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["512", "512"]
