"""Cut anywhere, resumed by another process: what was complete is not sent again."""

from random import Random

import pytest

from bridge.uploads.queue import State
from tests.support.eventually import eventually
from tests.support.upload_ground import Ground
from tests.support.uploading import (
    FLEET,
    MIB,
    ROBOT,
    Robot,
    Rows,
    content,
    running_receiver,
    running_uploads,
)

PART = 8 * MIB
SIZE = 2 * PART + 3 * MIB + 1
"""Three parts, the last one short."""
BORDERS = [border + by for border in (0, PART, 2 * PART, SIZE) for by in (-1, 0, 1)]
CUTS = sorted(
    {cut for cut in BORDERS if 0 < cut <= SIZE} | {Random(17).randrange(1, SIZE) for _ in range(4)} | {1}
)


@pytest.mark.parametrize("cut", CUTS)
async def test_a_cut_costs_at_most_one_part(ground: Ground, cut: int) -> None:
    robot, rows, data = Robot(), Rows(), content(SIZE, cut)
    robot.add("one", {"data.bin": data})
    ground.proxy.cut_at = cut
    async with running_receiver(ground.receivers[0]):
        async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys, rows) as running:
            await running.uploads.enqueue("one")

            async def cuts() -> int:
                return running.uploads.cuts

            await eventually(cuts, bool, "the connection is cut")
        # Another process, which knows the rows of the queue alone.
        async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys, rows) as running:
            await running.until("one", lambda upload: upload and upload.state is State.VERIFIED)
    assert ground.proxy.total - SIZE <= PART
    found = ground.server.client.get_object(Bucket=ground.store.bucket, Key=f"{FLEET}/{ROBOT}/one/data.bin")
    assert found["Body"].read() == data
