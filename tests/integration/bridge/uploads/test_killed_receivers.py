"""Receivers as real programs, killed with SIGKILL at random instants while recordings go up.

Whatever instant it is: what counts as verified is in the store byte for byte and signed for, everything is
verified in the end, and a kill costs at most a part that is sent again: parts go past receivers to the store.
"""

import asyncio
import hashlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from random import Random

import pytest

from bridge.uploads.queue import State
from fleet.connection import connect
from fleet.receipt_keys import confirmed
from omniseer.fleet.v1 import upload_pb2 as pb
from tests.support.receiver_program import ReceiverProgram
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, MIB, ROBOT, Robot, Running, content, running_uploads

PART = 8 * MIB
SIZE = PART + 3 * MIB + 1
"""Two parts, the last one short."""
RECORDINGS = 6
KILLS = 6
_WITHIN_S = 150.0

pytestmark = pytest.mark.timeout(240)


@pytest.fixture(autouse=True)
def _asks_again_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shortens what each kill costs at most, while a receiver reads, at another request, and after both."""
    monkeypatch.setattr("bridge.uploads.receivers._SILENT_S", 4.0)  # Two reports, not five.
    monkeypatch.setattr("bridge.uploads.receivers._ANSWER_S", 10.0)
    monkeypatch.setattr("bridge.uploads.uploads.LONGEST_PAUSE_S", 2.0)


@asynccontextmanager
async def two_receivers(ground: Ground, directory: Path) -> AsyncIterator[list[ReceiverProgram]]:
    programs = [ReceiverProgram(settings, directory) for settings in ground.receivers]
    try:
        await asyncio.gather(*(each.start() for each in programs))
        yield programs
    finally:
        for each in programs:
            each.end()


async def kill_at_random(programs: list[ReceiverProgram], random: Random, *, both: bool) -> None:
    """Kills one after the other, or both at once, at instants that nothing in the upload decides."""
    for _ in range(KILLS):
        await asyncio.sleep(random.uniform(0.0, 1.5))
        killed = programs if both else [random.choice(programs)]
        for each in killed:
            each.kill()
        await asyncio.gather(*(each.start() for each in killed))


def assert_only_what_is_right_counts(ground: Ground, expected: dict[str, bytes]) -> int:
    """Asserts that each receipt in the store is of the bytes that are there, and these the robot's.

    Returns:
        How many receipts of files there are.
    """
    client, bucket = ground.server.client, ground.store.bucket
    keys = [each["Key"] for each in client.list_objects_v2(Bucket=bucket).get("Contents", [])]
    receipts = [key for key in keys if ".receipts/" in key]
    for key in receipts:
        folder, _, name = key.partition(".receipts/")
        recording_id = folder.rpartition("/")[2]
        data = client.get_object(Bucket=bucket, Key=f"{folder}/{name}")["Body"].read()
        assert data == expected[recording_id]
        signed = pb.SignedReceipt.FromString(client.get_object(Bucket=bucket, Key=key)["Body"].read())
        said = pb.Receipt(
            fleet=FLEET,
            robot=ROBOT,
            recording_id=recording_id,
            file_name=name,
            size=len(data),
            sha256=hashlib.sha256(data).digest(),
        )
        confirmed(signed, ground.keys, said)
    return len(receipts)


async def check_while_it_runs(ground: Ground, running: Running, expected: dict[str, bytes]) -> None:
    """Asserts at each look that what the robot holds for verified is so."""
    verified: set[str] = set()
    while len(verified) < len(expected):
        upload = {each.recording_id: each.state for each in running.uploads.queue.settled}
        new = {name for name, state in upload.items() if state is State.VERIFIED} - verified
        if new:
            count = await asyncio.to_thread(assert_only_what_is_right_counts, ground, expected)
            verified |= new
            assert count >= len(verified)
        await asyncio.sleep(0.05)


@pytest.mark.parametrize(("seed", "both"), [(1, False), (3, True)])
async def test_killed_receivers_verify_nothing_wrongly_and_lose_nothing(
    ground: Ground, secure: SecureHub, tmp_path: Path, seed: int, both: bool
) -> None:
    robot = Robot()
    expected = {f"rec-{number}": content(SIZE, number) for number in range(RECORDINGS)}
    for recording_id, data in expected.items():
        robot.add(recording_id, {"data.bin": data})
    # One part is changed on its way: its file must be found wrong by whichever receiver reads it.
    ground.proxy.damage = 2
    async with (
        two_receivers(ground, tmp_path) as programs,
        running_uploads(
            robot, ground.hub, ground.proxy.host, ground.keys, max_bytes_per_s=12 * MIB
        ) as running,
    ):
        for recording_id in expected:
            await running.uploads.enqueue(recording_id)
        async with asyncio.timeout(_WITHIN_S):
            await asyncio.gather(
                kill_at_random(programs, Random(seed), both=both),
                check_while_it_runs(ground, running, expected),
            )
        assert sum(each.kills for each in programs) == (2 if both else 1) * KILLS
    assert assert_only_what_is_right_counts(ground, expected) == RECORDINGS
    # The damaged file was sent twice.
    again = ground.proxy.total - (RECORDINGS + 1) * SIZE
    assert again <= sum(each.kills for each in programs) * PART
    async with connect(secure.administrator()) as hub:
        await hub.connected(20)
        entries = await hub.entries("fleet_recordings")
    for recording_id, data in expected.items():
        stored = pb.StoredRecording.FromString(entries[f"{ROBOT}.{recording_id}"].value)
        assert [file.sha256 for file in stored.files] == [hashlib.sha256(data).digest()]


async def test_two_programs_race_for_the_same_files_while_they_are_killed(
    ground: Ground, tmp_path: Path
) -> None:
    robot = Robot()
    expected = {f"rec-{number}": content(SIZE, number) for number in range(3)}
    for recording_id, data in expected.items():
        robot.add(recording_id, {"data.bin": data})
    async with (
        two_receivers(ground, tmp_path) as programs,
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as one,
        # The same robot once more: two receivers complete, read and sign the same files at a time.
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as twin,
    ):
        for recording_id in expected:
            await one.uploads.enqueue(recording_id)
            await twin.uploads.enqueue(recording_id)
        async with asyncio.timeout(_WITHIN_S):
            await asyncio.gather(
                kill_at_random(programs, Random(4), both=False),
                check_while_it_runs(ground, one, expected),
                check_while_it_runs(ground, twin, expected),
            )
    assert assert_only_what_is_right_counts(ground, expected) == len(expected)
