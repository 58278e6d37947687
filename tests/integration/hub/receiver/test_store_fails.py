"""Each call of receivers to their store fails once: it is full, its key revoked, or it is cut afterwards."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import pytest

from bridge.config import UploadSettings
from bridge.uploads.attempt import Attempt, Parties
from bridge.uploads.parts import PartSender
from bridge.uploads.problems import AttemptError
from bridge.uploads.receivers import Receivers
from fleet.receipt_keys import ReceiptSigner
from hub.receiver.service import ReceiverService
from hub.receiver.store import Store, StoreError, StoreProblem
from hub.receiver.verified import THREADS, Party
from omniseer.fleet.v1 import upload_pb2 as pb
from tests.support.s3_server import S3Server
from tests.support.uploading import FLEET, ROBOT, Robot, content, new_signer

FILES = {"data.bin": content(100_000), "small.bin": b"x", "empty.bin": b""}
ATTEMPTS = 4
MOST_CALLS = 100


@dataclass
class Failing:
    """A store of which one call fails.

    Attributes:
        at: which; 0: none.
        problem: how.
        late: whether it fails after the store has done what it was requested to.
        calls: names of those so far.
    """

    store: Store
    at: int = 0
    problem: StoreProblem = StoreProblem.REFUSED
    late: bool = False
    calls: list[str] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.store, name)
        if name == "location":
            return found

        def call(*args: Any, **more: Any) -> Any:
            self.calls.append(name)
            fails = len(self.calls) == self.at
            if fails and not self.late:
                raise StoreError(self.problem, "it fails")
            result = found(*args, **more)
            if fails:
                raise StoreError(self.problem, "it fails")
            return result

        return call


class Records:
    """Lists recordings, and forgets them."""

    async def put(self, _bucket: str, _key: str, _value: bytes) -> None:
        """Takes it."""


class Hub:
    """Takes requests to a receiver, without servers between."""

    def __init__(self, service: ReceiverService) -> None:
        self._service = service

    async def request(self, subject: str, payload: bytes, _timeout_s: float) -> bytes:
        return [each async for each in self.request_many(subject, payload, 0.0)][-1]

    async def request_many(self, subject: str, payload: bytes, _silence_s: float) -> AsyncIterator[bytes]:
        answers: asyncio.Queue[bytes] = asyncio.Queue()

        async def send(answer: pb.UploadResponse) -> None:
            answers.put_nowait(answer.SerializeToString())

        await self._service.answer(ROBOT, subject.rpartition(".")[2], payload, send)
        while not answers.empty():
            yield answers.get_nowait()


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(THREADS) as threads:
        yield threads


@pytest.mark.parametrize(
    ("problem", "late"),
    [
        (StoreProblem.NO_ROOM, False),
        (StoreProblem.REFUSED, False),
        (StoreProblem.REFUSED, True),
    ],
    ids=["full", "revoked", "cut"],
)
async def test_each_failure_costs_attempts_and_nothing_else(
    store_server: S3Server, threads: ThreadPoolExecutor, problem: StoreProblem, *, late: bool
) -> None:
    signer, store = new_signer(), Store(store_server.settings())
    try:
        for at in range(1, MOST_CALLS):
            failing: Any = Failing(store, at, problem, late)
            # Each in a recording of its own, of which the store has nothing yet.
            failures = await uploaded(failing, f"one-{at:03}", signer, threads, store_server)
            if len(failing.calls) < at:
                assert at > 20, "every call has failed once"
                assert failures == 0
                return
    finally:
        store.close()
    pytest.fail("there is no end of calls")


async def uploaded(
    failing: Any, recording_id: str, signer: ReceiptSigner, threads: ThreadPoolExecutor, server: S3Server
) -> int:
    """Asserts that a recording is verified in spite of a call that fails.

    Returns:
        How many attempts have failed.
    """
    records: Any = Records()
    robot, at = Robot(), failing.at
    robot.add(recording_id, FILES)
    party = Party(FLEET, signer, (signer.public_key,))
    hub = Hub(ReceiverService(party, failing, records, threads))
    sends = UploadSettings(store_hosts=(server.url.removeprefix("http://"),), insecure_store=True)
    failures = 0
    async with PartSender(sends) as sender:
        parties = Parties(
            fleet=FLEET,
            robot=ROBOT,
            source=robot,
            receivers=Receivers(hub, ROBOT),
            sender=sender,
            keys=(signer.public_key,),
        )
        for _ in range(ATTEMPTS):
            attempt = Attempt(
                parties, recording_id, begun=lambda *_: None, progress=lambda _: None, sent=lambda: None
            )
            try:
                await attempt.run()
            except AttemptError:
                failures += 1
            else:
                break
        else:
            pytest.fail(f"not verified after {failing.calls[at - 1]}, call {at}, has failed once")
        sent = sender.sent_bytes
    keys = {name: f"{FLEET}/{ROBOT}/{recording_id}/{name}" for name in FILES}
    stored = {name: failing.store.read(key, 1_000_000) for name, key in keys.items()}
    assert stored == FILES, f"call {at}"
    assert sent == sum(map(len, FILES.values())), f"call {at}: no part is sent twice"
    return failures
