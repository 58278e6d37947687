"""The thread that talks to the gateway, with a robot that the test plays."""

import asyncio
import threading
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import replace

import pytest

from common.backoff import Backoff
from common.errors import UserError
from console.client import (
    CaughtUp,
    Clock,
    DeadlineExceeded,
    DesiredPreview,
    DriveOptions,
    DriveSession,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    GatewayError,
    GatewayFailed,
    InvalidRequest,
    KeyFrameAnswer,
    NotAllowed,
    Offset,
    Outage,
    OverlaySnapshot,
    Overloaded,
    PictureReport,
    PreviewChange,
    PreviewProfile,
    Refused,
    RobotStopped,
    Unreachable,
    Unsupported,
    WatchedStatus,
)
from console.client.results import EventKind, RobotTime, StopReset, TeleopAnswer
from console.monitor.conversation import RetryBackoff
from console.monitor.link import LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.viewer_feedback import answer_within_s
from console.monitor.worker import Worker
from tests.support.played_recordings import PlayedRecordings
from tests.support.snapshots import event, snapshot
from tests.support.waiting import wait_until

NEVER_S = 1e6
AT_ONCE_S = 0.0
ROBOT_NS = 5_000_000_000_000
"""What the robot's clock shows at each ping."""


class NotDriven:
    """The part of the client that drives; nothing here does."""

    def drive(self, options: DriveOptions | None = None) -> DriveSession:
        raise NotImplementedError(options)

    async def stop_robot(self, reason: str = "") -> RobotStopped:
        raise NotImplementedError(reason)

    async def reset_stop(self, stop_id: int) -> StopReset:
        raise NotImplementedError(stop_id)

    async def set_driving_enabled(self, enabled: bool) -> TeleopAnswer:
        raise NotImplementedError(enabled)


class PlayedRobot(NotDriven, PlayedRecordings):
    """Answers as the test sets it up, and records the calls."""

    def __init__(self) -> None:
        super().__init__()
        self.error: GatewayError | None = None
        self.streams = True
        """Whether it streams its status with detections; else it is an older one."""
        self.watching = 0
        self.pings = 0
        self.ping_error: GatewayError | None = None
        self.hangs = False
        self.looks = 0
        self.lists = snapshot()
        self.requests: list[DesiredPreview] = []
        self.requests_hang = False
        self.open = 0
        self.streamed: list[Event | EventGap | CaughtUp | Outage | GatewayError] = []
        self.asked_after: list[EventPosition | None] = []
        self.another_login = False
        self.clock = Clock()
        self.key_frames: list[int | None] = []
        self.key_frames_hang = False
        self.key_frame_error: Exception | None = None
        self.pictures: list[PictureReport] = []
        self.old = False

    @property
    def client(self) -> "PlayedRobot":
        return self

    @asynccontextmanager
    async def connect(self, _target: str) -> AsyncIterator["PlayedRobot"]:
        self.open += 1
        try:
            yield self
        finally:
            self.open -= 1

    async def watch_status(
        self, min_interval_s: float = 0.1, *, include_detections: bool = False
    ) -> AsyncGenerator[WatchedStatus | Outage]:
        self.watching += 1
        answered = False
        try:
            while True:
                try:
                    found = await self.overlay()
                except Unreachable as error:
                    if not answered:
                        raise
                    yield Outage(error, 1)
                else:
                    answered = True
                    here = self.streams and include_detections
                    yield WatchedStatus(
                        status=found.status,
                        monotonic_ns=None,
                        detections=found.detections if here else None,
                    )
                await asyncio.sleep(min_interval_s)
        finally:
            self.watching -= 1

    async def ping(self) -> Offset:
        self.pings += 1
        if self.ping_error:
            raise self.ping_error
        now_s = time.monotonic()
        self.clock.note(now_s, RobotTime(boot_id="1", monotonic_ns=ROBOT_NS, wall_clock_unix_ns=0), now_s)
        return Offset(0.0, 0.0)

    async def request_key_frame(self, newest_pts: int | None = None) -> KeyFrameAnswer:
        self.key_frames.append(newest_pts)
        if self.key_frames_hang:
            await asyncio.Event().wait()
        if self.old:
            raise Unsupported("an older robot")
        if self.key_frame_error:
            raise self.key_frame_error
        return KeyFrameAnswer(forced=True)

    async def report_picture(self, report: PictureReport) -> None:
        self.pictures.append(report)
        if self.old:
            raise Unsupported("an older robot")

    async def overlay(self) -> OverlaySnapshot:
        self.looks += 1
        if self.hangs:
            await asyncio.Event().wait()
        if self.error:
            raise self.error
        return self.lists

    async def set_preview(
        self,
        desired: DesiredPreview,
        *,
        settle_within_s: float = 10.0,  # noqa: ARG002  # the client's
    ) -> PreviewChange:
        return await self._take(desired)

    async def events(
        self, after: EventPosition | None = None
    ) -> AsyncIterator[Event | EventGap | CaughtUp | Outage]:
        self.asked_after.append(after)
        for item in self.streamed:
            if isinstance(item, GatewayError):
                raise item
            yield item
        await asyncio.Event().wait()

    async def refresh(self) -> bool:
        if self.another_login:
            self.another_login, self.error = False, None
            return True
        return False

    async def _take(self, desired: DesiredPreview) -> PreviewChange:
        self.requests.append(desired)
        if self.requests_hang:
            await asyncio.Event().wait()
        if self.error:
            raise self.error
        return PreviewChange(accepted=True, message="done", preview=snapshot().status.preview)


@pytest.fixture(params=[True, False], ids=["streamed", "polled"])
def robot(request: pytest.FixtureRequest) -> PlayedRobot:
    """One that streams its status, and an older one, which is polled."""
    played = PlayedRobot()
    played.streams = request.param
    return played


@contextmanager
def following(
    robot: PlayedRobot, on_change: Callable[[], None] = lambda: None, pause_s: float = NEVER_S
) -> Iterator[Worker]:
    retry = RetryBackoff(Backoff(pause_s, pause_s), Backoff(NEVER_S, NEVER_S))
    worker = Worker("robot", on_change, robot.connect, retry)
    worker.start()
    try:
        yield worker
    finally:
        assert worker.close(10)
        assert robot.open == robot.watching == 0


def reached(worker: Worker, link_state: LinkState) -> MonitorState:
    return wait_until(
        lambda: state if (state := worker.latest()).link.state is link_state else None, link_state.value
    )


def test_it_looks_again_and_again(robot: PlayedRobot) -> None:
    changes = threading.Semaphore(0)
    with following(robot, changes.release) as worker:
        for _ in range(3):
            assert changes.acquire(timeout=10)
        state = reached(worker, LinkState.CONNECTED)
        assert state.snapshot
        assert state.link.answer_ms is not None


def test_a_robot_that_is_gone_is_lost_since_it_was_heard_last(robot: PlayedRobot) -> None:
    with following(robot) as worker:
        reached(worker, LinkState.CONNECTED)
        robot.error = Unreachable("gone")
        lost = reached(worker, LinkState.LOST)
        assert lost.link.error is robot.error
        assert lost.link.since_s == lost.heard_s >= lost.received_s
        assert lost.snapshot, "what was known stays known"


def test_it_tries_again_by_itself_and_counts(robot: PlayedRobot) -> None:
    robot.error = Unreachable("gone")
    with following(robot, pause_s=AT_ONCE_S) as worker:
        wait_until(lambda: worker.latest().link.attempts >= 3, "three attempts")
        began_s = worker.latest().link.since_s
        robot.error = None
        state = reached(worker, LinkState.CONNECTED)
        assert state.link.attempts == 0
        assert state.link.since_s > began_s


def test_a_streamed_status_is_watched_once_and_the_round_trip_measured_besides() -> None:
    robot = PlayedRobot()
    with following(robot) as worker:
        first = reached(worker, LinkState.CONNECTED)
        wait_until(lambda: robot.pings >= 2, "pings")
        later = wait_until(
            lambda: state if (state := worker.latest()).link.answer_ms != first.link.answer_ms else None,
            "the answer's time of a ping",
        )
        assert robot.watching == 1
        assert later.heard_s > first.heard_s
        assert later.link.since_s == first.link.since_s


def test_a_gateway_without_the_stream_is_polled_and_not_pinged() -> None:
    robot = PlayedRobot()
    robot.streams = False
    with following(robot) as worker:
        reached(worker, LinkState.CONNECTED)
        wait_until(lambda: robot.looks > 8, "it is polled for longer than a ping's period")
        assert robot.watching == robot.pings == 0


def test_a_gateway_that_answers_no_ping_is_lost_although_its_stream_is_open() -> None:
    robot = PlayedRobot()
    robot.ping_error = DeadlineExceeded("the gateway did not answer")
    with following(robot) as worker:
        assert reached(worker, LinkState.LOST).link.error is robot.ping_error
        wait_until(lambda: robot.watching == 0, "its stream is closed")


def test_a_stream_that_ends_because_of_the_login_is_explained_by_a_call() -> None:
    robot = PlayedRobot()
    with following(robot) as worker:
        reached(worker, LinkState.CONNECTED)
        robot.ping_error = NotAllowed("the token of anna was revoked")
        robot.error = NotAllowed("the credential that opened this stream is no longer valid")
        assert reached(worker, LinkState.LOST).link.error is robot.ping_error


def test_the_operator_need_not_wait_for_the_next_attempt(robot: PlayedRobot) -> None:
    robot.error = Unreachable("gone")
    with following(robot, pause_s=NEVER_S) as worker:
        reached(worker, LinkState.LOST)
        assert worker.latest().link.next_try_s
        robot.error = None
        worker.retry_now()
        reached(worker, LinkState.CONNECTED)


def test_a_login_that_is_refused_is_not_shown_again_and_again(robot: PlayedRobot) -> None:
    robot.error = NotAllowed("the token of anna was revoked")
    robot.streamed = [robot.error]
    with following(robot, pause_s=AT_ONCE_S) as worker:
        lost = reached(worker, LinkState.LOST)
        assert lost.link.next_try_s
        assert lost.link.next_try_s > time.monotonic() + 1e5
        worker.retry_now()
        wait_until(lambda: robot.looks == 2, "it is, when the operator wants it")
        assert len(robot.asked_after) == 1, "who asks for events waits until there is an answer at all"
        robot.streamed = []
        robot.another_login = True
        assert reached(worker, LinkState.CONNECTED).link.attempts == 0
        wait_until(lambda: len(robot.asked_after) == 2, "events are asked for again")


def test_a_request_is_carried_out_and_its_outcome_kept(robot: PlayedRobot) -> None:
    with following(robot) as worker:
        worker.switch(DesiredPreview(True, PreviewProfile.LOW_BW))
        request = wait_until(
            lambda: found if (found := worker.latest().request) and not found.pending else None,
            "an outcome",
        )
        assert robot.requests == [DesiredPreview(True, PreviewProfile.LOW_BW)]
        assert isinstance(request.outcome, PreviewChange)
        assert (taken := worker.latest().snapshot)
        assert taken.status.preview == request.outcome.preview, "its effect is shown at once"
        worker.switch(DesiredPreview(False))
        wait_until(lambda: robot.requests[-1] == DesiredPreview(False), "the next one")


def test_changes_are_reported_by_one_thread_alone(robot: PlayedRobot) -> None:
    threads: set[str] = set()
    with following(robot, lambda: threads.add(threading.current_thread().name)) as worker:
        reached(worker, LinkState.CONNECTED)
        worker.switch(DesiredPreview(True))
        assert worker.latest().request, "the request is in the state at once"
        wait_until(lambda: robot.requests, "the request")
    assert threads == {"gateway-worker"}


def test_one_request_at_a_time(robot: PlayedRobot) -> None:
    robot.requests_hang = True
    with following(robot) as worker:
        worker.switch(DesiredPreview(True))
        wait_until(lambda: robot.requests, "the first")
        worker.switch(DesiredPreview(False))
        looks = robot.looks
        wait_until(lambda: robot.looks > looks + 1, "it goes on looking meanwhile")
        assert robot.requests == [DesiredPreview(True)]


def test_a_refusal_is_an_outcome(robot: PlayedRobot) -> None:
    robot.error = Refused("not today")
    with following(robot) as worker:
        worker.switch(DesiredPreview(True))
        wait_until(lambda: (found := worker.latest().request) and found.outcome is robot.error, "the refusal")


def happened(sequence: int) -> Event:
    return Event(
        position=EventPosition("run", sequence),
        monotonic_ns=0,
        wall_clock_unix_ms=5_000_000,
        severity=FaultSeverity.ERROR,
        component="odometry",
        message=f"event {sequence}",
        kind=EventKind.FAULT_RAISED,
    )


def texts(worker: Worker) -> list[str]:
    return [line.text for line in worker.latest().events.lines]


def test_events_are_streamed_and_go_on_where_they_broke_off(robot: PlayedRobot) -> None:
    robot.streamed = [happened(1), happened(2), Unreachable("gone")]
    with following(robot, pause_s=AT_ONCE_S) as worker:
        wait_until(lambda: len(robot.asked_after) > 1, "it asks again")
        assert robot.asked_after[:2] == [None, EventPosition("run", 2)]
        assert texts(worker)[:2] == ["error: odometry: event 1", "error: odometry: event 2"]


def test_a_gateway_that_streams_no_events_is_read_from_its_snapshots() -> None:
    robot = PlayedRobot()
    robot.streams = False
    robot.streamed = [Unsupported("an old gateway")]
    robot.lists = snapshot(lambda made: made.events.append(event(7, "preview running")))
    with following(robot) as worker:
        wait_until(lambda: texts(worker) == ["preview running"], "the event")
        looks = robot.looks
        wait_until(lambda: robot.looks > looks + 2, "it looks again")
        assert texts(worker) == ["preview running"]


@pytest.mark.parametrize(
    "error",
    [Overloaded("too many"), Unreachable("gone"), DeadlineExceeded("late"), GatewayFailed("a defect")],
    ids=lambda error: type(error).__name__,
)
def test_events_are_asked_for_again_after_an_error_and_a_pause(error: GatewayError) -> None:
    robot = PlayedRobot()
    robot.streamed = [error]
    with following(robot) as worker:
        wait_until(lambda: robot.asked_after, "it asks")
        asked_s = time.monotonic()
        wait_until(lambda: len(robot.asked_after) > 1, "it asks again")
        assert time.monotonic() - asked_s > 0.4
        robot.streamed = [happened(1)]
        wait_until(lambda: texts(worker) == ["error: odometry: event 1"], "the event")


def test_a_position_that_is_refused_is_not_asked_for_again() -> None:
    robot = PlayedRobot()
    robot.streamed = [happened(7), InvalidRequest("this run has not reached it")]
    with following(robot):
        wait_until(lambda: len(robot.asked_after) > 1, "it asks again")
        assert robot.asked_after[:2] == [None, None]


def test_a_gateway_that_streams_events_after_its_update_is_asked_for_them() -> None:
    robot = PlayedRobot()
    robot.streamed = [Unsupported("an old gateway")]
    with following(robot, pause_s=AT_ONCE_S) as worker:
        reached(worker, LinkState.CONNECTED)
        wait_until(lambda: robot.asked_after, "it asks")
        robot.streamed = [happened(1)]
        robot.error = robot.ping_error = Unreachable("it is started anew")
        reached(worker, LinkState.LOST)
        robot.error = robot.ping_error = None
        wait_until(lambda: texts(worker) == ["error: odometry: event 1"], "the event")


def test_it_ends_in_the_middle_of_a_call(robot: PlayedRobot) -> None:
    robot.hangs = robot.requests_hang = True
    with following(robot) as worker:
        worker.switch(DesiredPreview(True))
        wait_until(lambda: robot.looks and robot.requests, "both calls hang")


def test_orders_after_the_end_do_nothing(robot: PlayedRobot) -> None:
    with following(robot) as worker:
        pass
    worker.switch(DesiredPreview(True))
    worker.retry_now()
    assert worker.close()
    assert not robot.requests


def test_the_loop_ends_after_what_the_client_still_does() -> None:
    """The completion of a cancelled call reaches the loop a little later, from gRPC."""
    ends = []

    async def cancelled_call() -> None:
        try:
            await asyncio.sleep(0.05)
        finally:
            ends.append("cancelled" if asyncio.current_task().cancelling() else "completed")  # type: ignore[union-attr]

    @asynccontextmanager
    async def connect(_target: str) -> AsyncIterator[PlayedRobot]:
        yield PlayedRobot()
        tasks.add(asyncio.create_task(cancelled_call()))

    tasks: set[asyncio.Task[None]] = set()
    worker = Worker("robot", lambda: None, connect)
    worker.start()
    assert worker.close(10)
    assert ends == ["completed"]


def test_never_started_is_closed_at_once(robot: PlayedRobot) -> None:
    assert Worker("robot", lambda: None, robot.connect).close()


def test_an_invalid_address_is_reported_at_once() -> None:
    with pytest.raises(UserError, match="not the address"):
        Worker("http://robot/", lambda: None)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_fault_of_our_own_does_not_look_like_a_robot_that_stands_still() -> None:
    @asynccontextmanager
    async def broken(target: str) -> AsyncIterator[PlayedRobot]:
        if target:
            raise ZeroDivisionError("ours")
        yield PlayedRobot()

    worker = Worker("robot", lambda: None, broken)
    worker.start()
    state = reached(worker, LinkState.LOST)
    assert "ZeroDivisionError" in str(state.link.error)
    assert worker.close(10)
    assert replace(state) == worker.latest()


def test_the_robots_clock_is_known_from_the_first_ping_on() -> None:
    robot = PlayedRobot()
    with following(robot) as worker:
        offset = wait_until(worker.clock_offset, "an offset")
        assert (time.monotonic() + offset.seconds) * 1e9 == pytest.approx(ROBOT_NS, abs=30e9)
        robot.error = Unreachable("gone")
        robot.ping_error = robot.error
        reached(worker, LinkState.LOST)
        assert worker.clock_offset(), "video goes on without the gateway"


def test_a_key_frame_is_requested_while_the_robot_answers() -> None:
    robot = PlayedRobot()
    with following(robot) as worker:
        wait_until(lambda: worker.request_key_frame(7), "it takes requests")
        wait_until(lambda: robot.key_frames == [7], "the request")
        robot.error = robot.ping_error = Unreachable("gone")
        reached(worker, LinkState.LOST)
        assert not worker.request_key_frame(8)
    assert not worker.request_key_frame(9)


def test_three_requests_are_sent_at_once_and_the_newest_of_those_that_follow_later() -> None:
    """As many as the robot takes; a second tear at once does not wait."""
    robot = PlayedRobot()
    with following(robot) as worker:
        begun_s = time.monotonic()
        wait_until(lambda: worker.request_key_frame(0), "it takes requests")
        for pts in range(3):
            assert worker.request_key_frame(pts)
            wait_until(lambda: pts in robot.key_frames, "a request of the burst")  # noqa: B023 - at once
        for pts in range(3, 100):
            assert worker.request_key_frame(pts)
        wait_until(lambda: robot.key_frames[-1] == 99, "the last request")
        assert time.monotonic() - begun_s > 0.33
    assert len(robot.key_frames) <= 5


@pytest.mark.parametrize(
    "error",
    [NotAllowed("a stranger"), Refused("the preview is off"), DeadlineExceeded("late"), TimeoutError()],
)
def test_a_request_that_failed_leaves_it_to_a_new_connection_to_the_stream(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.monitor.viewer_feedback._FAILED_FOR_S", 0.2)
    robot = PlayedRobot()
    robot.key_frame_error = error
    with following(robot) as worker:
        wait_until(lambda: worker.request_key_frame(1), "it takes requests")
        wait_until(lambda: not worker.takes_requests(), "it does not any more")
        assert not worker.request_key_frame(2)
        robot.key_frame_error = None
        wait_until(lambda: worker.request_key_frame(3), "another attempt")
        wait_until(lambda: robot.key_frames == [1, 3], "the request")
        assert worker.latest().link.state is LinkState.CONNECTED


def test_a_request_that_is_not_answered_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    round_trips_s: list[float | None] = []

    def within_s(rtt_s: float | None) -> float:
        round_trips_s.append(rtt_s)
        return 0.05

    monkeypatch.setattr("console.monitor.viewer_feedback.answer_within_s", within_s)
    robot = PlayedRobot()
    robot.key_frames_hang = True
    with following(robot) as worker:
        wait_until(worker.clock_offset, "a ping")
        wait_until(lambda: worker.request_key_frame(1), "it takes requests")
        wait_until(lambda: not worker.takes_requests(), "it does not any more")
    assert round_trips_s == [pytest.approx(0.0, abs=0.01)], "as the pings, which this robot answers at once"


@pytest.mark.parametrize(
    ("rtt_s", "expected_s"), [(None, 1.0), (0.0, 0.4), (0.02, 0.44), (0.2, 0.8), (0.5, 1.0)]
)
def test_an_answer_is_waited_for_by_the_round_trip(rtt_s: float | None, expected_s: float) -> None:
    assert answer_within_s(rtt_s) == pytest.approx(expected_s)


def test_an_older_robot_is_asked_once() -> None:
    robot = PlayedRobot()
    robot.old = True
    with following(robot) as worker:
        wait_until(lambda: worker.request_key_frame(1), "it might take requests")
        wait_until(lambda: not worker.request_key_frame(2), "it does not")
        assert len(robot.key_frames) == 1
        assert worker.latest().link.state is LinkState.CONNECTED


@pytest.mark.parametrize("old", [False, True])
def test_the_picture_is_reported_once_a_second(old: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.monitor.viewer_feedback._REPORT_S", 0.01)
    robot = PlayedRobot()
    robot.old = old
    shown: list[PictureReport] = []

    def picture() -> PictureReport | None:
        """None at first, as long as no picture is shown."""
        shown.append(PictureReport(picture_age_ms=len(shown)))
        return shown[-1] if len(shown) > 3 else None

    worker = Worker("robot", lambda: None, robot.connect, picture=picture)
    worker.start()
    try:
        wait_until(lambda: len(robot.pictures) >= (1 if old else 3), "reports")
        assert worker.latest().link.state is LinkState.CONNECTED
    finally:
        assert worker.close(10)
    assert robot.pictures == shown[3 : 4 if old else 3 + len(robot.pictures)]
