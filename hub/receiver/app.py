"""Assembles a receiver, starts its parts in order and stops them in reverse."""

import asyncio
import logging
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, nullcontext
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Final

from common import bind, rpc
from common.health import Health
from common.metrics_endpoint import serving_metrics
from common.tasks import first_to_end
from fleet.connection import FleetAddress, Hub, connect
from fleet.errors import HubError
from fleet.names import READING_SUBJECTS, RECEIVERS, UPLOAD_SUBJECTS
from fleet.receipt_keys import read_public_keys, read_signer
from fleet.serving import Handler, Request
from hub.receiver.config import ReceiverSettings
from hub.receiver.metrics import ReceiverMetrics
from hub.receiver.service import ReceiverService, busy
from hub.receiver.store import Store, StoreError
from hub.receiver.verified import THREADS, Party
from omniseer.fleet.v1.upload_pb2 import UploadResponse

_log = logging.getLogger(__name__)

SERVICE: Final = "receiver"
"""Of the health service: whether the receiver is connected to the hub."""
AT_ONCE: Final = 8
"""Requests in hand of those that read files again, of the others, and of people; further ones get BUSY."""
OF_ONE: Final = 4
"""Of these, of one robot, which uploads one file at a time: the others are served whatever it does."""
_LONG: Final = frozenset({"verify_file", "complete_upload"})
"""Requests for which a receiver reads for minutes; other robots begin and send files meanwhile."""
_SWEEP_EVERY_S: Final = 3600.0
_MOST_SWEPT: Final = 1000
_MOST_LOOKED_AT: Final = 100_000
"""Uploads that run; the store lists them 1000 at a time."""
_NAMES: Final = frozenset(field.name for field in UploadResponse.DESCRIPTOR.fields) - {"error"}


async def serve(settings: ReceiverSettings, stop: asyncio.Event) -> None:
    """Answers robots and people until `stop`.

    Raises:
        UserError: A key can't be read, or a socket can't be used.
    """
    party = party_of(settings)
    address = FleetAddress(
        settings.hub.servers, settings.hub.credentials, settings.hub.ca, name=f"receiver of {settings.fleet}"
    )
    async with _opened(settings) as (store, threads), connect(address) as hub:
        service = ReceiverService(party, store, hub, threads)
        metrics = ReceiverMetrics(lambda: service.bytes_read, lambda: hub.link.connected)
        health = Health()
        server = rpc.new_server()
        health.register(server)
        bind.bind_unix(server, settings.socket)
        await server.start()
        port = settings.metrics.port
        page = nullcontext() if port is None else serving_metrics(metrics.text, settings.metrics.host, port)
        try:
            async with page:
                for subjects, of_people in ((UPLOAD_SUBJECTS, False), (READING_SUBJECTS, True)):
                    handler = _handler(service, metrics, of_people=of_people)
                    await hub.serve(
                        subjects,
                        RECEIVERS,
                        handler,
                        at_once=AT_ONCE,
                        of_one=OF_ONE,
                        busy=busy(),
                        of_people=of_people,
                        long=_LONG,
                    )
                _log.info("receiving recordings of the fleet %s", settings.fleet)
                await first_to_end(
                    stop.wait(),
                    hub.lasting(),
                    _report_health(hub, health),
                    _sweep_for_ever(settings, store, threads, metrics),
                )
        finally:
            await server.stop(rpc.STOP_GRACE_S)
            settings.socket.unlink(missing_ok=True)


def party_of(settings: ReceiverSettings) -> Party:
    """Returns as whom a receiver confirms.

    Raises:
        UserError: A key can't be read.
    """
    signer = read_signer(settings.signing_key)
    others = read_public_keys(settings.receipt_keys) if settings.receipt_keys else ()
    return Party(settings.fleet, signer, (signer.public_key, *others))


@asynccontextmanager
async def _opened(settings: ReceiverSettings) -> AsyncIterator[tuple[Store, ThreadPoolExecutor]]:
    store = Store(settings.store)
    threads = ThreadPoolExecutor(THREADS, thread_name_prefix="store")
    try:
        yield store, threads
    finally:
        # What is being read ends by the deadlines of the store.
        await asyncio.to_thread(threads.shutdown, wait=True, cancel_futures=True)
        store.close()


def _handler(service: ReceiverService, metrics: ReceiverMetrics, *, of_people: bool) -> Handler:
    async def handle(request: Request) -> None:
        async def send(response: UploadResponse) -> None:
            await request.respond(response.SerializeToString())

        name = request.name if request.name in _NAMES else "other"
        with metrics.in_hand.track_inprogress():
            try:
                outcome = await service.answer(
                    request.robot, request.name, request.payload, send, of_people=of_people
                )
            except HubError as error:
                # Without an answer the request is repeated.
                _log.warning("%s of %s got no answer: %s", name, request.robot, error)
                outcome = "no answer"
        metrics.count(name, outcome)

    return handle


async def _report_health(hub: Hub, health: Health) -> None:
    reported = None

    def changed() -> bool:
        return hub.link is not reported

    while True:
        await hub.changed.wait_until(changed)
        reported = hub.link
        health.set_serving(SERVICE, serving=reported.connected)


async def _sweep_for_ever(
    settings: ReceiverSettings, store: Store, threads: ThreadPoolExecutor, metrics: ReceiverMetrics
) -> None:
    loop = asyncio.get_running_loop()
    while True:
        oldest = datetime.now(UTC) - timedelta(days=settings.keep_parts_days)
        try:
            count = await loop.run_in_executor(threads, sweep, store, f"{settings.fleet}/", oldest)
            metrics.swept.inc(count)
        except StoreError as error:
            _log.warning("abandoned uploads could not be looked for: %s", error)
        await asyncio.sleep(_SWEEP_EVERY_S)


def sweep(store: Store, prefix: str, before: datetime) -> int:
    """Deletes uploads that were begun before an instant and not completed, 1000 at the most.

    Several receivers may do so at once. An upload that a robot then goes on with is begun again.

    Returns:
        How many were deleted.

    Raises:
        StoreError: The store does not answer.
    """
    found = islice(store.open_uploads(prefix), _MOST_LOOKED_AT)
    old = list(islice((each for each in found if each.begun < before), _MOST_SWEPT))
    for upload in old:
        store.abort(upload)
    return len(old)
