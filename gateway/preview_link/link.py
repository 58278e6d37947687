"""The connection to the preview service: keeps it up, brings the wish over, takes the truth in."""

import asyncio
import logging
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, NoReturn

import grpc

from common import request_id
from common.broadcast import Broadcast
from gateway.preview_link.reconciler import Reconciler
from gateway.preview_link.wire import UnknownSpeechError, from_wire, to_wire
from gateway.preview_link.wish import Wish
from gateway.status.preview import PreviewView, Profile
from omniseer.preview.v1.preview_service_pb2 import (
    ActualState,
    WatchActualStateRequest,
    WatchActualStateResponse,
)
from omniseer.preview.v1.preview_service_pb2_grpc import PreviewServiceStub

if TYPE_CHECKING:
    # Exists in the generated stubs alone: the name that a type checker knows the asyncio form by.
    from omniseer.preview.v1.preview_service_pb2_grpc import PreviewServiceAsyncStub

_log = logging.getLogger(__name__)

SILENCE_S: Final = 2.5
"""The service gives a sign of life every 2 s at the latest; this long without one and it is gone."""
APPLY_DEADLINE_S: Final = 2.0
"""Taking a wish in is a matter of milliseconds for a service that lives."""
FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 1.0

_CHANNEL_OPTIONS: Final = (
    # A new attempt is a new connection; gRPC's own pauses (1 s to 120 s), which it shares between the
    # channels of a process, must not come on top of ours.
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.enable_retries", 0),
    ("grpc.max_receive_message_length", 256 * 1024),
)
_GONE: Final = frozenset(
    {grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.CANCELLED}
)


class _Trouble(NamedTuple):
    """What broke a session, in words. The exception itself would keep the call, and so the connection."""

    for_people: str
    in_full: str


class PreviewLink:
    """Knows the preview from memory while `run` keeps the contact; the preview goes on without us.

    Args:
        socket: where the preview service listens, or will.
        reconciler: what decides.
        clock: seconds, monotonic.
    """

    def __init__(
        self, socket: Path, reconciler: Reconciler, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._socket = socket
        self._reconciler = reconciler
        self._clock = clock
        self._failures_in_a_row = 0
        self.changes = Broadcast()

    @property
    def view(self) -> PreviewView:
        """What is known of the preview now, from memory."""
        return self._reconciler.view

    @property
    def wish(self) -> Wish:
        """What is wanted now."""
        return self._reconciler.wish

    def ask(self, *, enabled: bool, profile: Profile | None) -> Wish:
        """Takes a new wish of an operator; it is on its way when this returns."""
        wish = self._reconciler.ask(enabled=enabled, profile=profile, request_id=request_id.current())
        _log.info(
            "wish %d: %s", wish.revision, f"on, {wish.profile.value}" if wish.profile and enabled else "off"
        )
        self.changes.notify_all()
        return wish

    def renew_passphrase(self) -> None:
        """Who knows the present one watches no longer; whoever may watch finds the next one in the view."""
        if self._reconciler.renew_passphrase():
            _log.info("wish %d: another passphrase", self.wish.revision)
            self.changes.notify_all()

    def settled(self, wish: Wish) -> bool:
        """Whether the wish has come to something or was replaced."""
        return self._reconciler.settled(wish)

    async def wait_until_settled(self, wish: Wish, timeout_s: float) -> None:
        """Waits for that, `timeout_s` at most."""
        await self.changes.wait_until(lambda: self.settled(wish), timeout_s)

    async def run(self) -> NoReturn:
        """Until cancelled: a session until it breaks, a pause that grows and that a new wish cuts short."""
        while True:
            trouble = await self._session()
            self._failures_in_a_row += 1
            if self._reconciler.lost(trouble.for_people):
                _log.warning("preview service lost: %s", trouble.in_full)
            elif self._failures_in_a_row == 1:
                _log.warning("preview service not reached at %s: %s", self._socket, trouble.in_full)
            self.changes.notify_all()
            await self._pause(self._failures_in_a_row)

    async def _pause(self, failures: int) -> None:
        revision = self._reconciler.wish.revision
        pause_s = min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2 ** min(failures - 1, 10))
        await self.changes.wait_until(lambda: self._reconciler.wish.revision != revision, pause_s)

    async def _session(self) -> _Trouble:
        """One connection, until it breaks; returns what broke it."""
        async with grpc.aio.insecure_channel(f"unix:{self._socket}", options=_CHANNEL_OPTIONS) as channel:
            stub: PreviewServiceAsyncStub = PreviewServiceStub(channel)
            try:
                await _first_to_end(self._listen(stub), self._keep_applied(stub))
            except (grpc.aio.AioRpcError, TimeoutError, UnknownSpeechError) as trouble:
                return _Trouble(_for_people(trouble), _in_full(trouble))

    async def _listen(self, stub: "PreviewServiceAsyncStub") -> None:
        stream = stub.WatchActualState(WatchActualStateRequest())
        while True:
            message = await _next_word(stream)
            if message is None:
                raise TimeoutError
            if not isinstance(message, WatchActualStateResponse):
                raise UnknownSpeechError("it ended its report without a word")
            self._take(message.actual)

    async def _keep_applied(self, stub: "PreviewServiceAsyncStub") -> None:
        rounds = 0
        while True:
            await self.changes.wait_until(lambda: self._reconciler.pending() is not None)
            wish = self._reconciler.pending()
            if wish is None:
                continue
            await self._apply(stub, wish)
            # Taken in, as a rule. If not (two gateways at one service), not more often than the pause allows.
            rounds = rounds + 1 if self._reconciler.pending() else 0
            if rounds:
                await self._pause(rounds)

    async def _apply(self, stub: "PreviewServiceAsyncStub", wish: Wish) -> None:
        metadata = ((request_id.HEADER, wish.request_id),) if wish.request_id else None
        try:
            reply = await stub.ApplyDesiredState(to_wire(wish), timeout=APPLY_DEADLINE_S, metadata=metadata)
        except grpc.aio.AioRpcError as error:
            if error.code() in _GONE:
                raise
            _log.error("preview service refused revision %d: %s", wish.revision, _in_full(error))
            self._reconciler.refused(wish, error.details() or error.code().name)
            self.changes.notify_all()
            return
        self._take(reply.actual)

    def _take(self, message: ActualState) -> None:
        if self._reconciler.heard(from_wire(message), self._clock()):
            _log.info(
                "preview service connected (process %s), after %d failed attempts",
                message.instance_id,
                self._failures_in_a_row,
            )
            self._failures_in_a_row = 0
        self.changes.notify_all()


async def _next_word(stream: Any) -> object | None:
    """What comes next; None when nothing comes in time. An exception would keep the call, as above."""
    try:
        async with asyncio.timeout(SILENCE_S):
            message: object = await stream.read()
            return message
    except TimeoutError:
        return None


async def _first_to_end(*jobs: Coroutine[Any, Any, None]) -> NoReturn:
    """Runs endless jobs side by side until one raises, and raises that.

    No TaskGroup: in Python 3.11.2, Debian 12's, it leaves the task that ran it marked as cancelled, and the
    next timeout in that task then cancels it.
    """
    tasks = [asyncio.create_task(job) for job in jobs]
    try:
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        ended.pop().result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        # Their exception knows this frame: kept here, both would outlive the connection.
        tasks.clear()
    raise AssertionError("an endless job ended quietly")


def _for_people(trouble: Exception) -> str:
    if isinstance(trouble, grpc.aio.AioRpcError):
        return "nothing answers on its socket" if trouble.code() in _GONE else _in_full(trouble)
    if isinstance(trouble, TimeoutError):
        return f"no word for {SILENCE_S:g} s"
    return str(trouble)


def _in_full(trouble: Exception) -> str:
    if isinstance(trouble, grpc.aio.AioRpcError):
        return f"{trouble.code().name} {trouble.details()}"
    return _for_people(trouble)
