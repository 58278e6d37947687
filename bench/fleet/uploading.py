"""What a kill amid an upload costs: bytes that are sent twice, over a real hub, receiver and store (moto's).

What is killed has the bridge's uploads and a gateway of its own, and the next one is asked for the recording
anew: tests/integration/bridge/uploads/test_killed_bridge.py kills the bridge itself.
"""

import asyncio
import random
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.eventually import eventually
from tests.support.helper import first_line
from tests.support.s3_server import S3Server, faulty_store, s3_server
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.upload_program import Setup, upload_program
from tests.support.uploading import MIB, ROBOT, receiver_settings, running_receiver

_SIZE: Final = 40 * MIB
_BYTES_PER_S: Final = 16 * MIB
"""So that it is killed within a part, not after the last."""
_WITHIN_S: Final = 120.0


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    """Kills the process at a random byte of an upload; another one goes on."""
    with secure_hub(workdir / "hub") as hub, s3_server(workdir) as server:
        hub.enroll(ROBOT)
        hub.receiver()
        twice = [asyncio.run(_sent_twice_mib(hub, server, workdir, seed)) for seed in range(FEWEST_ROUNDS)]
    log(f"fleet: {', '.join(f'{each:.1f}' for each in twice)} MiB sent twice")
    return [
        Row(
            name="fleet.upload_resume_mib",
            what=f"process with the bridge's uploads killed at a random byte of {_SIZE // MIB} MiB: "
            "bytes that another one sends again",
            unit="MiB",
            values=twice,
            bar=8,
            judged="worst",
        )
    ]


async def _sent_twice_mib(hub: SecureHub, server: S3Server, workdir: Path, seed: int) -> float:
    at = random.Random(seed).randrange(_SIZE)  # repeatable
    async with faulty_store(server) as proxy:
        store = server.settings(public_endpoint=proxy.url)
        setup = Setup(hub.servers.urls, str(hub.path / ROBOT), proxy.host, _SIZE, _BYTES_PER_S)
        async with running_receiver(receiver_settings(hub, store, workdir)):
            with upload_program(setup) as first:

                async def total() -> int:
                    return proxy.total

                await eventually(total, lambda now: now >= at, f"{at} bytes have arrived", _WITHIN_S)
                first.kill()
                first.wait()
            with upload_program(setup) as second:
                last = await asyncio.to_thread(first_line, second)
        if last != "verified\n":
            raise RuntimeError("the second process did not finish the upload")
        return max(0, proxy.total - _SIZE) / MIB
