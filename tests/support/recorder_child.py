"""A recorder to be killed: `python -m tests.support.recorder_child ROOT FIRST`.

Records numbered messages from FIRST on, 500 a second, into the recording that runs in ROOT, or a new one.
Each line of standard output is the number of a message and when it was handed over, in calendar ns.
"""

import asyncio
import sys
import time
from pathlib import Path
from typing import Final

from recorder.recording.lifecycle import State
from recorder.recording.requests import StartOptions
from tests.support.recorder_in_process import Source, running_recorder

_PERIOD_S: Final = 0.002


async def main(root: Path, first: int) -> None:
    """Records until the process is killed."""
    async with running_recorder(root, segments={"max_s": 1}) as running:
        if running.status_reader.running is None:
            await running.operations.start("child", StartOptions())
        await running.until(lambda: running.status_reader.phase.state is State.RECORDING)
        source = Source(running.queue, sent=first - 1)
        while True:
            source.send(size=1000)
            print(source.sent, time.time_ns(), flush=True)
            await asyncio.sleep(_PERIOD_S)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
