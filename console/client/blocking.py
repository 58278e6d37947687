"""The blocking client: a facade over the asyncio client, which runs in a thread of its own."""

import functools
import weakref
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import suppress
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from console.client.aio import AsyncGatewayClient
from console.client.drive_session import DriveOptions, DriveSession
from console.client.errors import Cancelled, GatewayError
from console.client.loop_thread import LoopThread, shared_loop
from console.client.options import ClientOptions
from console.client.results import DriveLimits, DriveState
from console.credentials import Credentials
from console.target import DEFAULT_TARGET

P = ParamSpec("P")
ResultT = TypeVar("ResultT")


def _blocking(
    method: Callable[Concatenate[AsyncGatewayClient, P], Coroutine[Any, Any, ResultT]],
) -> Callable[Concatenate["GatewayClient", P], ResultT]:
    """Returns the method of the facade that waits for the result of an asyncio method."""

    @functools.wraps(method)
    def call(self: "GatewayClient", /, *args: P.args, **kwargs: P.kwargs) -> ResultT:
        return self._loop.run(method(self._client, *args, **kwargs))

    return call


def _iterating(
    method: Callable[Concatenate[AsyncGatewayClient, P], AsyncIterator[ResultT]],
) -> Callable[Concatenate["GatewayClient", P], Iterator[ResultT]]:
    """Returns the method of the facade that iterates over an asyncio stream."""

    @functools.wraps(method)
    def iterate(self: "GatewayClient", /, *args: P.args, **kwargs: P.kwargs) -> Iterator[ResultT]:
        yield from _items_of(method(self._client, *args, **kwargs), self._loop)

    return iterate


def _items_of(stream: AsyncIterator[ResultT], loop: LoopThread) -> Iterator[ResultT]:
    """Yields the items of an asyncio stream, which runs in that loop."""
    try:
        while True:
            try:
                item = loop.run(_next(stream))
            except StopAsyncIteration:
                return
            yield item
    finally:
        # Not waited for: the garbage collector may close this iterator in the loop's own thread.
        with suppress(Cancelled):
            loop.submit(_close(stream))


class BlockingDriveSession:
    """As `DriveSession`, for blocking code; commands go out in the client's own thread."""

    def __init__(self, loop: LoopThread, session: DriveSession) -> None:
        self._loop = loop
        self._session = session
        self.hold = session.hold
        self.release = session.release
        self.reasons = session.reasons
        self.check = session.check

    @property
    def state(self) -> DriveState | None:
        """The robot's newest state; None before the first."""
        return self._session.state

    @property
    def limits(self) -> DriveLimits | None:
        """What the robot accepts."""
        return self._session.limits

    @property
    def error(self) -> GatewayError | None:
        """Why the session has ended; None while it lasts."""
        return self._session.error

    @property
    def lapsed(self) -> bool:
        """Whether a hold was not renewed in time: until a release, no other counts."""
        return self._session.lapsed

    @property
    def is_ready(self) -> bool:
        """Whether a hold would move the robot."""
        return self._session.is_ready

    @property
    def state_age_s(self) -> float:
        """Time since the newest state has arrived; infinite before the first."""
        return self._session.state_age_s

    @property
    def open_lanes(self) -> int:
        """Lanes that are connected."""
        return self._session.open_lanes

    def states(self) -> Iterator[DriveState]:
        """As `DriveSession.states`."""
        return _items_of(self._session.states(), self._loop)

    def ready(self, within_s: float = 2.0) -> DriveState:
        """As `DriveSession.ready`."""
        return self._loop.run(self._session.ready(within_s))

    def hold_for(self, seconds: float, vx_mps: float, vy_mps: float = 0.0, wz_rad_s: float = 0.0) -> None:
        """As `DriveSession.hold_for`."""
        self._loop.run(self._session.hold_for(seconds, vx_mps, vy_mps, wz_rad_s))

    def __enter__(self) -> Self:
        self._loop.run(self._session.__aenter__())
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Cancelled):
            self._loop.run(self._session.__aexit__(None, None, None))


class GatewayClient:
    """Client of one robot's gateway, for blocking code. May be used from several threads at once.

    Every method does what that of `AsyncGatewayClient` does, and returns when the answer is there; streams
    are ordinary iterators.

    Example:
        with GatewayClient("robot.local") as robot:
            print(robot.status().health.summary)
            change = robot.enable_preview(PreviewProfile.BALANCED)
            print(change.preview.endpoint)

    Arguments and errors are those of `AsyncGatewayClient`.
    """

    def __init__(
        self,
        target: str = DEFAULT_TARGET,
        options: ClientOptions | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        async def create() -> AsyncGatewayClient:
            return AsyncGatewayClient(target, options, credentials)

        self._loop = shared_loop.acquire()
        try:
            self._client = self._loop.run(create())
        except BaseException:
            shared_loop.release(self._loop)
            raise
        # Also at the end of a program that does not close its client.
        self._end = weakref.finalize(self, _end, self._loop, self._client)
        self.target = self._client.target
        self.clock = self._client.clock

    status = _blocking(AsyncGatewayClient.status)
    overlay = _blocking(AsyncGatewayClient.overlay)
    info = _blocking(AsyncGatewayClient.info)
    enable_preview = _blocking(AsyncGatewayClient.enable_preview)
    disable_preview = _blocking(AsyncGatewayClient.disable_preview)
    set_preview = _blocking(AsyncGatewayClient.set_preview)
    ping = _blocking(AsyncGatewayClient.ping)
    request_key_frame = _blocking(AsyncGatewayClient.request_key_frame)
    report_picture = _blocking(AsyncGatewayClient.report_picture)
    stop_robot = _blocking(AsyncGatewayClient.stop_robot)
    reset_stop = _blocking(AsyncGatewayClient.reset_stop)
    set_driving_enabled = _blocking(AsyncGatewayClient.set_driving_enabled)
    send_velocity = _blocking(AsyncGatewayClient.send_velocity)
    start_recording = _blocking(AsyncGatewayClient.start_recording)
    stop_recording = _blocking(AsyncGatewayClient.stop_recording)
    trigger_snapshot = _blocking(AsyncGatewayClient.trigger_snapshot)
    list_recordings = _blocking(AsyncGatewayClient.list_recordings)
    recording = _blocking(AsyncGatewayClient.recording)
    recording_thumbnail = _blocking(AsyncGatewayClient.recording_thumbnail)
    pin_recording = _blocking(AsyncGatewayClient.pin_recording)
    delete_recording = _blocking(AsyncGatewayClient.delete_recording)
    upload_recording = _blocking(AsyncGatewayClient.upload_recording)
    cancel_upload = _blocking(AsyncGatewayClient.cancel_upload)
    export_recording = _blocking(AsyncGatewayClient.export_recording)
    recordings = _iterating(AsyncGatewayClient.recordings)
    recording_pages = _iterating(AsyncGatewayClient.recording_pages)
    upload_progress = _iterating(AsyncGatewayClient.upload_progress)
    read_recording = _iterating(AsyncGatewayClient.read_recording)
    watch_status = _iterating(AsyncGatewayClient.watch_status)
    events = _iterating(AsyncGatewayClient.events)

    @property
    def reconnects(self) -> int:
        """Connections after the first one of each stream, of all streams together."""
        return self._client.reconnects

    @property
    def retries(self) -> int:
        """Attempts beyond the first, of all calls together."""
        return self._client.retries

    def drive(self, options: DriveOptions | None = None) -> "BlockingDriveSession":
        """Returns a session for driving, to be used in a `with` block: its end stops the robot."""

        async def create() -> DriveSession:
            return self._client.drive(options)

        return BlockingDriveSession(self._loop, self._loop.run(create()))

    def close(self) -> None:
        """Closes the connection. Pending calls and streams in other threads end with `Cancelled`."""
        with suppress(Cancelled):
            self._loop.run(self._client.close())
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _end(loop: LoopThread, client: AsyncGatewayClient) -> None:
    # Not waited for: the garbage collector may call this in the loop's own thread.
    with suppress(Cancelled):
        loop.submit(client.close())
    shared_loop.release(loop)


async def _next(items: AsyncIterator[ResultT]) -> ResultT:
    return await anext(items)


async def _close(items: Any) -> None:
    await items.aclose()
