"""What a cut connection costs an export: bytes that cross the link twice.

A relay counts what reaches the client, and cuts the connection at a random byte. What the same export needs
over a connection that holds is subtracted, so that the frames of HTTP/2 do not count.
"""

import asyncio
import random
import shutil
import tempfile
from pathlib import Path
from typing import Final

from bench.export.ground import ExportingRobot
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from console.client import AsyncGatewayClient, ExportOptions
from tests.support.eventually import eventually
from tests.support.relay import Relay

ROUNDS: Final = 2 * FEWEST_ROUNDS
BYTES_PER_S: Final = 32 * 1024 * 1024
"""So that it is cut while bytes are under way."""
BAR_KIB: Final = 256
_WITHIN_S: Final = 120.0


def rows(robot: ExportingRobot, _wanted: set[str]) -> list[Row]:
    whole = asyncio.run(passed_bytes(robot, None))
    twice_kib = []
    for seed in range(ROUNDS):
        at = random.Random(seed).randrange(robot.recording.size // 20, robot.recording.size)  # repeatable
        twice_kib.append(max(0.0, (asyncio.run(passed_bytes(robot, at)) - whole) / 1024))
        log(f"export: cut at {at} of {robot.recording.size} bytes, {twice_kib[-1]:.0f} KiB sent twice")
    return [
        Row(
            name="export.resume_kib",
            what="connection cut at a random byte of an export: bytes that reach the client twice",
            unit="KiB",
            values=twice_kib,
            bar=BAR_KIB,
            judged="worst",
        )
    ]


async def passed_bytes(robot: ExportingRobot, cut_at: int | None) -> int:
    """Copies the recording over a connection that is cut once; returns how many bytes reach the client.

    Raises:
        RuntimeError: the connection was not cut, or the copy is not the whole recording.
    """
    folder = Path(tempfile.mkdtemp(dir=robot.directory))
    try:
        async with (
            Relay(robot.gateway.port) as relay,
            AsyncGatewayClient(f"127.0.0.1:{relay.port}") as client,
        ):
            options = ExportOptions(max_bytes_per_s=BYTES_PER_S)
            copy = asyncio.create_task(client.export_recording(robot.recording, folder / "copy", options))
            if cut_at is not None:

                async def passed() -> int:
                    return relay.to_clients

                await eventually(passed, lambda now: now >= cut_at, f"{cut_at} bytes have passed", _WITHIN_S)
                relay.cut()
            found = await copy
            if found.cuts != (cut_at is not None) or found.size != robot.recording.size:
                raise RuntimeError(f"{found.cuts} cuts, {found.size} bytes: nothing was measured")
            return relay.to_clients
    finally:
        shutil.rmtree(folder)
