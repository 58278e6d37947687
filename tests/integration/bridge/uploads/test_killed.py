"""Uploads that are killed: another process goes on, and another receiver takes over.

test_killed_bridge.py and test_killed_receivers.py kill the programs themselves.
"""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from random import Random

import pytest

from bridge.uploads.queue import State
from fleet.connection import connect
from fleet.names import RECEIVERS, UPLOAD_SUBJECTS
from fleet.receipt_keys import read_signer
from fleet.serving import Request
from hub.receiver.service import ReceiverService
from hub.receiver.store import Store
from hub.receiver.verified import THREADS, Party
from omniseer.fleet.v1.upload_pb2 import UploadResponse
from tests.support.eventually import eventually
from tests.support.helper import first_line
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.upload_program import FILE, RECORDING, Setup, upload_program
from tests.support.uploading import (
    FLEET,
    MIB,
    ROBOT,
    Robot,
    content,
    running_receiver,
    running_uploads,
)

PART = 8 * MIB
SIZE = 3 * PART + 12_345


@pytest.mark.parametrize("seed", range(3))
async def test_a_killed_process_costs_at_most_one_part(ground: Ground, secure: SecureHub, seed: int) -> None:
    setup = Setup(secure.servers.urls, str(secure.path / ROBOT), ground.proxy.host, SIZE)
    at = Random(seed).randrange(PART, SIZE)
    async with running_receiver(ground.receivers[0]):
        with upload_program(setup) as first:

            async def total() -> int:
                return ground.proxy.total

            await eventually(total, lambda now: now >= at, f"{at} bytes have arrived", 60)
            first.kill()
            first.wait()
        with upload_program(setup) as second:
            assert await asyncio.to_thread(first_line, second) == "verified\n"
    assert ground.proxy.total - SIZE <= PART
    found = ground.server.client.get_object(
        Bucket=ground.store.bucket, Key=f"{FLEET}/{ROBOT}/{RECORDING}/{FILE}"
    )
    assert found["Body"].read() == content(SIZE)


async def test_another_receiver_answers_when_one_dies_while_it_reads(
    ground: Ground, secure: SecureHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bridge.uploads.receivers._SILENT_S", 4.0)  # Two reports, not five.
    robot = Robot()
    robot.add("one", {"data.bin": content(MIB)})
    settings, taken = ground.receivers[0], asyncio.Event()
    signer = read_signer(settings.signing_key)
    address = secure.address(secure.path / "receiver" / "receiver.creds")
    async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running:
        with ThreadPoolExecutor(THREADS) as threads:
            async with connect(address) as dying:
                party = Party(FLEET, signer, (signer.public_key,))
                service = ReceiverService(party, Store(settings.store), dying, threads)

                async def handle(request: Request) -> None:
                    async def send(response: UploadResponse) -> None:
                        await request.respond(response.SerializeToString())

                    if request.name == "verify_file":
                        taken.set()
                    else:
                        await service.answer(request.robot, request.name, request.payload, send)

                await dying.connected(20)
                await dying.serve(UPLOAD_SUBJECTS, RECEIVERS, handle)
                await running.uploads.enqueue("one")
                await asyncio.wait_for(taken.wait(), 20)
        async with running_receiver(ground.receivers[1]):
            await running.until("one", lambda each: each is not None and each.state is State.VERIFIED, 40)
        assert running.uploads.cuts <= 1, "it was asked again, and not sent again"
    assert ground.proxy.total == MIB
