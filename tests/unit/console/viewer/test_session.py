"""The session with calls that the test plays; real streams are in tests/integration/console/viewer."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import pytest

from common.backoff import Backoff
from console.client import Unreachable
from console.client.results import PreviewState
from console.receiver.address import StreamAddress
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.errors import UndecodableError, ended, from_srt, no_picture, receiver_failed
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions
from console.viewer.playback import PlaybackState
from console.viewer.session import VideoSession
from tests.support.suspends import PlayedSuspends
from tests.support.waiting import wait_until
from tests.unit.console.receiver.frames import frame
from tests.unit.console.viewer.previews import preview


@dataclass
class Exchange:
    """Every connection that was made; a test puts frames and ends into the queues."""

    refuse: bool = False
    hangs: bool = False
    calls: list[tuple[StreamAddress, FrameQueue]] = field(default_factory=list)
    open: int = 0
    delivery: Delivery = field(default_factory=lambda: Delivery(kind=DeliveryChoice.DIRECT, rtt_ms=7.0))
    received_s: float | None = 12.5
    options: list[ReceiverOptions] = field(default_factory=list)

    def connect(self, address: StreamAddress, queue: FrameQueue, options: ReceiverOptions) -> "Exchange":
        self.options.append(options)
        self.calls.append((address, queue))
        self.open += 1
        if self.refuse:
            queue.end(from_srt(address, "Incorrect passphrase", had_data=False))
        return self

    def close(self) -> bool:
        self.open -= 1
        return not self.hangs

    def show(self) -> Frame:
        """A frame arrives over the latest connection."""
        latest = replace(frame(), arrival_s=time.monotonic())
        self.calls[-1][1].put(latest)
        return latest


@pytest.fixture
def exchange() -> Exchange:
    return Exchange()


@pytest.fixture
def session(exchange: Exchange) -> Iterator[VideoSession]:
    session = VideoSession(connect=exchange.connect)
    session.start()
    yield session
    assert session.close()
    assert exchange.open == 0


def called(exchange: Exchange, times: int) -> None:
    wait_until(lambda: len(exchange.calls) >= times, f"{times} calls")


def test_nothing_is_called_until_the_gateway_names_a_stream(
    session: VideoSession, exchange: Exchange
) -> None:
    session.follow(preview(PreviewState.DISABLED))
    assert session.playback().state is PlaybackState.OFF
    assert exchange.calls == []
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)


def test_the_latest_frame_is_kept_and_passed_to_listeners(session: VideoSession, exchange: Exchange) -> None:
    received: list[Frame] = []
    session.add_frame_listener(received.append)
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    for number in (1, 2, 3):
        latest = exchange.show()
        wait_until(lambda latest=latest: session.latest_frame() is latest, "the frame is kept")  # type: ignore[misc]
        assert session.frames == len(received) == number
    assert session.playback().state is PlaybackState.LIVE


def test_a_lost_call_is_made_again_and_counted(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    for number in (1, 2, 3):
        called(exchange, number)
        address, queue = exchange.calls[-1]
        queue.end(ended(address, "lost"))
    called(exchange, 4)
    assert session.redials == session.playback().redials == 3


def test_silence_is_a_loss(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    exchange.show()
    called(exchange, 2)
    now = session.playback()
    assert now.state is PlaybackState.FROZEN
    assert now.frame_age_s is not None
    assert now.frame_age_s >= 1
    assert "fell silent" in now.reason


def test_a_stream_without_any_frame_is_reported_with_the_time_waited(
    session: VideoSession, exchange: Exchange, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.viewer.session.deadline_s", lambda connected_s, _frame_s: connected_s)
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 2)
    assert "no frame from srt://127.0.0.1:7100 within 4 s" in session.playback().reason


def test_another_address_is_called_at_once(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    session.follow(preview(PreviewState.RUNNING, port=7200))
    called(exchange, 2)
    assert [address.port for address, _ in exchange.calls] == [7100, 7200]
    assert session.redials == 0


def test_the_gateway_may_be_away_while_frames_come(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    session.gateway_lost(Unreachable("no gateway"))
    exchange.show()
    wait_until(session.latest_frame, "a frame")
    assert session.playback().state is PlaybackState.LIVE
    assert len(exchange.calls) == 1


def test_an_old_frame_does_not_outlive_its_preview(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    exchange.show()
    wait_until(session.latest_frame, "a frame")
    session.follow(preview(PreviewState.DISABLED))
    assert session.latest_frame() is None
    wait_until(lambda: exchange.open == 0, "hung up")
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 2)
    assert session.playback().state is PlaybackState.CONNECTING


def test_a_wrong_passphrase_blocks_until_there_is_another(session: VideoSession, exchange: Exchange) -> None:
    exchange.refuse = True
    session.follow(preview(PreviewState.RUNNING, passphrase="not the right one"))
    wait_until(lambda: session.playback().state is PlaybackState.BLOCKED, "blocked")
    assert "passphrase" in session.playback().reason
    assert "right one" not in session.playback().reason
    exchange.refuse = False
    session.follow(preview(PreviewState.RUNNING, passphrase="the right one"))
    called(exchange, 2)
    exchange.show()
    wait_until(lambda: session.playback().state is PlaybackState.LIVE, "live")


def test_an_address_that_cannot_be_used_blocks(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING, passphrase="short"))
    assert session.playback().state is PlaybackState.BLOCKED
    assert exchange.calls == []


def test_what_cannot_be_decoded_blocks(session: VideoSession, exchange: Exchange) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    exchange.calls[-1][1].end(UndecodableError("it sends video/mpeg", "Look at the port", final=True))
    wait_until(lambda: session.playback().state is PlaybackState.BLOCKED, "blocked")
    assert session.playback().remedy == "Look at the port"


def test_a_connection_that_cannot_be_closed_is_left_behind_and_said_so(
    session: VideoSession, exchange: Exchange
) -> None:
    exchange.hangs = True
    session.follow(preview(PreviewState.RUNNING))
    for number in (1, 2):
        called(exchange, number)
        address, queue = exchange.calls[-1]
        queue.end(ended(address, "lost"))
        wait_until(lambda: "did not stop within 2 s" in session.playback().reason, "the reason")
    exchange.hangs = False
    called(exchange, 3)
    exchange.show()
    wait_until(lambda: session.playback().state is PlaybackState.LIVE, "the video goes on")


def test_connections_that_cannot_be_closed_are_no_more_than_three(
    session: VideoSession, exchange: Exchange
) -> None:
    """Each keeps a thread, and maybe a driver."""
    exchange.hangs = True
    session.follow(preview(PreviewState.RUNNING))
    for number in (1, 2, 3):
        called(exchange, number)
        address, queue = exchange.calls[-1]
        queue.end(ended(address, "lost"))
    wait_until(lambda: session.playback().state is PlaybackState.BLOCKED, "no further one")
    assert "3 receivers did not stop" in session.playback().reason
    assert session.playback().remedy == "Close the window and open it again"
    assert len(exchange.calls) == 3


def test_a_session_that_never_began_can_be_closed() -> None:
    assert VideoSession().close()


def test_the_receiver_gets_what_the_session_was_given(exchange: Exchange) -> None:
    requests: list[int | None] = []

    def request(newest_pts: int | None) -> bool:
        requests.append(newest_pts)
        return True

    session = VideoSession(
        connect=exchange.connect,
        delivery=DeliveryChoice.SRT,
        robot_now_ns=lambda: 5_000_000_000,
        on_picture_lost=request,
        takes_requests=lambda: not requests,
    )
    assert session.delivery() is None
    session.start()
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    wait_until(lambda: session.delivery() is exchange.delivery, "the connection's figures")
    assert session.close()
    (options,) = exchange.options
    assert options.delivery is DeliveryChoice.SRT
    assert options.capture is None, "the endpoint names no offset"
    assert options.on_picture_lost
    assert options.on_picture_lost(90_000)
    assert requests == [90_000]
    assert not options.takes_requests()


def test_frames_get_capture_times_where_the_endpoint_has_an_offset(exchange: Exchange) -> None:
    session = VideoSession(connect=exchange.connect, robot_now_ns=lambda: 5_000_000_000)
    session.start()
    session.follow(preview(PreviewState.RUNNING, capture_offset_ns=-3_600_000_000_000))
    called(exchange, 1)
    assert session.close()
    capture = exchange.options[0].capture
    assert capture
    assert capture.offset_ns == -3_600_000_000_000
    assert capture.robot_now_ns() == 5_000_000_000


def test_a_connection_that_is_made_anew_by_itself_is_not_silent(
    session: VideoSession, exchange: Exchange
) -> None:
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    exchange.show()
    wait_until(session.latest_frame, "a frame")
    until_s = time.monotonic() + 2.5
    while time.monotonic() < until_s:
        exchange.delivery = replace(exchange.delivery, rejoins=exchange.delivery.rejoins + 1)
        time.sleep(0.5)
    assert len(exchange.calls) == 1
    exchange.show()
    wait_until(lambda: session.frames == 2, "a frame")
    called(exchange, 2)


@pytest.fixture
def pauses_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses so far; none is made."""
    pauses_s = list[float]()
    original = Backoff.next_s

    def next_s(self: Backoff) -> float:
        pauses_s.append(original(self))
        return 0.0

    monkeypatch.setattr(Backoff, "next_s", next_s)
    return pauses_s


def test_a_stream_of_which_too_little_comes_says_what_to_do_and_is_called_ever_less_often(
    session: VideoSession, exchange: Exchange, pauses_s: list[float]
) -> None:
    session.follow(preview(PreviewState.RUNNING))
    for number in range(1, 6):
        called(exchange, number)
        address, queue = exchange.calls[-1]
        queue.end(no_picture(address, 5.0))
    called(exchange, 6)
    assert pauses_s == [1.0, 2.0, 4.0, 5.0, 5.0]
    now = session.playback()
    assert now.state is PlaybackState.CONNECTING
    assert now.reason == "packets come from srt://127.0.0.1:7100, but no whole picture for 5 s"
    assert now.remedy.endswith("Type: robotctl preview on --profile low-bw")
    exchange.show()
    wait_until(lambda: session.playback().state is PlaybackState.LIVE, "live")
    assert session.playback().reason == ""
    exchange.calls[-1][1].end(no_picture(address, 5.0))
    called(exchange, 7)
    assert pauses_s[5:] == [1.0], "a picture begins it anew"


def test_after_a_defect_of_the_receiver_it_is_called_as_seldom(
    session: VideoSession, exchange: Exchange, pauses_s: list[float]
) -> None:
    """One that recurs costs all viewers a key frame each time."""
    session.follow(preview(PreviewState.RUNNING))
    for number in range(1, 6):
        called(exchange, number)
        exchange.calls[-1][1].end(receiver_failed(OverflowError("-1 does not fit")))
    called(exchange, 6)
    assert pauses_s == [1.0, 2.0, 4.0, 5.0, 5.0]


def test_a_frame_of_before_a_suspend_is_frozen_for_as_long(
    session: VideoSession, exchange: Exchange, monkeypatch: pytest.MonkeyPatch
) -> None:
    suspends = PlayedSuspends()
    monkeypatch.setattr("console.viewer.session.SuspendedTime", suspends)
    session.follow(preview(PreviewState.RUNNING))
    called(exchange, 1)
    exchange.show()
    wait_until(session.latest_frame, "a frame")
    assert session.playback().state is PlaybackState.LIVE
    suspends.total_s += 3600
    now = session.playback()
    assert now.state is PlaybackState.FROZEN
    assert now.frame_age_s is not None
    assert now.frame_age_s > 3600
    exchange.show()
    wait_until(lambda: session.playback().state is PlaybackState.LIVE, "live")


def test_why_there_was_no_video_is_forgotten_once_the_preview_is_off(session: VideoSession) -> None:
    session.follow(preview(PreviewState.RUNNING, passphrase="short"))
    assert session.playback().state is PlaybackState.BLOCKED
    session.follow(preview(PreviewState.DISABLED))
    off = session.playback()
    assert (off.state, off.reason) == (PlaybackState.OFF, "")
    session.follow(replace(preview(PreviewState.STARTING), endpoint=None))
    starting = session.playback()
    assert (starting.state, starting.reason, starting.remedy) == (PlaybackState.CONNECTING, "", "")
