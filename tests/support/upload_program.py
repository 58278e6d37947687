"""Uploads in a process of its own, to be killed: python -m tests.support.upload_program, settings on stdin.

Its recording has one file of the size in the settings, of content that the test can make as well. It prints
"uploading" when it begins and "verified" when it has ended.
"""

import asyncio
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from bridge.uploads.queue import State
from fleet.connection import FleetAddress, connect
from fleet.receipt_keys import read_public_keys
from tests.support.helper import first_line, helper
from tests.support.uploading import ROBOT, Robot, content, running_uploads

RECORDING: Final = "one"
FILE: Final = "data.bin"
_WITHIN_S: Final = 120.0


@dataclass(frozen=True)
class Setup:
    """What the program is to do; `files` is the folder of the robot's enrolment."""

    servers: tuple[str, ...]
    files: str
    store_host: str
    size: int
    max_bytes_per_s: int = 0


@contextmanager
def upload_program(setup: Setup) -> Iterator[subprocess.Popen[str]]:
    """Uploads when the block begins, gone when it ends."""
    with helper("tests.support.upload_program") as process:
        assert process.stdin
        process.stdin.write(json.dumps(asdict(setup)) + "\n")
        process.stdin.flush()
        assert first_line(process) == "uploading\n"
        yield process


async def _run(setup: Setup) -> None:
    files = Path(setup.files)
    address = FleetAddress(setup.servers, files / "bridge.creds", files / "ca.pem", f"_INBOX_{ROBOT}")
    robot = Robot()
    robot.add(RECORDING, {FILE: content(setup.size)})
    keys = read_public_keys(files / "receipts.pub")
    async with connect(address) as hub:
        await hub.connected(_WITHIN_S)
        async with running_uploads(
            robot, hub, setup.store_host, keys, max_bytes_per_s=setup.max_bytes_per_s
        ) as running:
            print("uploading", flush=True)
            await running.uploads.enqueue(RECORDING)
            await running.until(
                RECORDING, lambda each: each is not None and each.state is State.VERIFIED, _WITHIN_S
            )
    print("verified", flush=True)


if __name__ == "__main__":
    asyncio.run(_run(Setup(**json.loads(sys.stdin.readline()))))
