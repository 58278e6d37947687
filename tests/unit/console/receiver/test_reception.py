"""One connection's loop with a socket and a decoder that the test plays."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from console.capture_time import WRAP_TICKS, CaptureClock, ticks_to_ns
from console.receiver.delivery import Delivery, DeliveryChoice, LinkStatistics
from console.receiver.options import ReceiverOptions
from console.receiver.reception import Reception, repeat_s, wait_s
from console.receiver.transport_stream import AccessUnit
from tests.support.mpegts_writer import Writer, coded_frame

TICKS = 3000
GOP = 5
FIRST_WAIT_S = 0.6
"""While SRT has not measured the round trip yet."""
TICK_S = 0.01
"""How much the clock advances each time that the socket is waited on."""


@dataclass
class Played:
    """Socket, decoder and clock of one connection, all in the test's hand."""

    packets: deque[tuple[float, int, bytes]] = field(default_factory=deque)
    """When each arrives, its number and payload."""
    now_s: float = 100.0
    rtt_ms: float = 20.0
    units: list[AccessUnit] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    reports: list[Delivery] = field(default_factory=list)
    requests_s: list[float] = field(default_factory=list)
    requested_pts: list[int | None] = field(default_factory=list)
    takes_requests: bool = True
    received: int = 0
    lost_share: float = 0.0
    full_until_s: float = 0.0
    dropped_units: int = 0
    stopping: threading.Event = field(default_factory=threading.Event)
    until_s: float = 110.0

    def first_number(self) -> int:
        return 0

    def wait(self, _timeout_s: float) -> bool:
        self.now_s += TICK_S
        if self.now_s > self.until_s:
            self.stopping.set()
        return False

    def receive(self) -> tuple[int, bytes] | None:
        if self.packets and self.packets[0][0] <= self.now_s:
            self.received += 1
            return self.packets.popleft()[1:]
        return None

    def statistics(self) -> LinkStatistics:
        return LinkStatistics(self.rtt_ms, 3 + round(self.lost_share * self.received), self.received)

    def record(self, payload: bytes) -> None:
        self.payloads.append(payload)

    def push(self, unit: AccessUnit) -> bool:
        taken = self.now_s > self.full_until_s
        if taken:
            self.units.append(unit)
        else:
            self.dropped_units += 1
        return taken

    def feed(self) -> None:
        pass

    def check(self) -> None:
        pass

    def request(self, newest_pts: int | None) -> bool:
        self.requests_s.append(self.now_s)
        self.requested_pts.append(newest_pts)
        return self.takes_requests

    @property
    def shown(self) -> list[int]:
        return [(unit.pts_ticks or 0) // TICKS for unit in self.units]

    def run(self, **options: object) -> Delivery:
        """Receives until the end, or until the connection is to be made anew."""
        totals = Delivery(kind=DeliveryChoice.DIRECT)
        given = ReceiverOptions(**options)  # type: ignore[arg-type]
        Reception(self, self, given, totals, self.reports.append).run(self.stopping)
        return self.reports[-1]


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Played:
    made = Played()
    monkeypatch.setattr("console.receiver.reception.time.monotonic", lambda: made.now_s)
    return made


def send(
    played: Played,
    frames: int,
    *,
    lose: Callable[[int, int], bool] = lambda _frame, _packet: False,
    delay_s: Callable[[int], float] = lambda _frame: 0.0,
    first_ticks: int = 0,
) -> None:
    """Sends frames at 30 per second, each in payloads of two packets; `lose` by frame and payload."""
    writer, number = Writer(), 0
    for frame in range(frames):
        key = frame % GOP == 0
        packets = [writer.tables()] if key else []
        packets += writer.unit(
            coded_frame("h264", frame, key=key, size=1000), (first_ticks + frame * TICKS) % WRAP_TICKS
        )
        content = b"".join(packets)
        for index, at in enumerate(range(0, len(content), 376)):
            if not lose(frame, index):
                arrival_s = 100.0 + frame / 30 + delay_s(frame)
                played.packets.append((arrival_s, number, content[at : at + 376]))
            number += 1


def test_every_frame_of_a_clean_link_is_decoded(played: Played) -> None:
    send(played, 60)
    found = played.run()
    assert played.shown == list(range(60))
    assert found == Delivery(
        kind=DeliveryChoice.DIRECT, rtt_ms=20.0, lost=3, wait_ms=250, loss_percent=found.loss_percent
    )


def test_a_late_packet_is_waited_for(played: Played) -> None:
    send(played, 30)
    late = next(each for each in played.packets if each[1] == 20)
    played.packets.remove(late)
    arrival_s = late[0] + 0.1
    before = sum(each[0] <= arrival_s for each in played.packets)
    played.packets.insert(before, (arrival_s, *late[1:]))
    found = played.run()
    assert played.shown == list(range(30))
    assert (found.given_up, found.dropped_frames) == (0, 0)


def test_after_a_packet_is_given_up_no_torn_frame_is_decoded(played: Played) -> None:
    send(played, 30, lose=lambda frame, packet: (frame, packet) == (7, 1))
    found = played.run(on_picture_lost=played.request)
    assert played.shown == [*range(7), *range(10, 30)]
    assert played.units[7].first
    assert (found.given_up, found.dropped_frames, found.rejoins) == (1, 3, 0)
    # Once: frame 7 was given up 250 ms after what follows it, and by then its key frame was there.
    assert len(played.requests_s) <= 1


def test_a_lost_clock_reference_tears_no_picture(played: Played) -> None:
    """At low frame rates there are some between the frames, each in a datagram of its own."""
    writer = Writer()
    for frame in range(30):
        key = frame % GOP == 0
        unit = writer.unit(coded_frame("h264", frame, key=key), frame * TICKS)
        content = (writer.tables() if key else b"") + b"".join(unit)
        played.packets.append((100 + frame / 30, 2 * frame, content))
        if frame != 7:
            reference = writer.reference(frame * TICKS)
            played.packets.append((100 + (frame + 0.5) / 30, 2 * frame + 1, reference))
    found = played.run(on_picture_lost=played.request)
    assert played.shown == list(range(30))
    assert (found.given_up, found.dropped_frames) == (1, 0)
    assert played.requests_s == []


def test_a_key_frame_is_requested_at_once_and_again_while_none_comes(played: Played) -> None:
    send(played, 60, lose=lambda frame, packet: frame >= 7 and packet == 1)
    played.until_s = 102.0
    played.run(on_picture_lost=played.request)
    given_up_s = 100 + 7 / 30 + FIRST_WAIT_S
    assert played.requests_s[0] == pytest.approx(given_up_s, abs=0.03)
    steps = [b - a for a, b in pairwise(played.requests_s)]
    # The second one when the round trip is measured, and what is missing is waited for a shorter time.
    assert steps == pytest.approx([repeat_s(FIRST_WAIT_S, 20.0), repeat_s(wait_s(20.0), 20.0)], abs=0.02)
    # Not that of the newest whole frame, the one before 7: a key frame after that may be what is lost.
    requested = [pts or 0 for pts in played.requested_pts]
    assert requested[0] >= 7 * TICKS
    assert requested == sorted(requested)


@pytest.mark.parametrize(("rtt_ms", "expected_s"), [(0, 0.3), (20, 0.37), (80, 0.73), (200, 0.9)])
def test_a_request_is_repeated_when_its_key_frame_would_have_been_given_up(
    rtt_ms: float, expected_s: float
) -> None:
    assert repeat_s(wait_s(rtt_ms), rtt_ms) == pytest.approx(expected_s)


def hit(last: int) -> Callable[[int, int], bool]:
    """Returns a loss of a packet in the middle of frame 62, and of each key frame after it up to `last`."""
    lost = {(62, 1), *((frame, 2) for frame in range(65, last + 1, GOP))}
    return lambda frame, packet: (frame, packet) in lost


@pytest.mark.parametrize("rtt_ms", [20.0, 80.0])
def test_a_key_frame_that_is_hit_as_well_is_requested_again_at_once(played: Played, rtt_ms: float) -> None:
    """Once a packet of it is given up; when that of frame 85 is, the next key frame has come."""
    played.rtt_ms, played.until_s = rtt_ms, 104.0
    send(played, 100, lose=hit(last=85))
    played.run(on_picture_lost=played.request)
    given_up_s = [100 + frame / 30 + wait_s(rtt_ms) for frame in (62, 65, 70, 75, 80)]
    assert played.requests_s == pytest.approx(given_up_s, abs=0.03)


def test_where_the_first_key_frame_is_hit_another_one_is_requested_at_once(played: Played) -> None:
    send(played, 40, lose=lambda frame, packet: packet == 2 and frame in range(0, 25, GOP))
    played.run(on_picture_lost=played.request)
    assert played.requests_s[0] == pytest.approx(100 + FIRST_WAIT_S, abs=0.03)
    assert played.shown == list(range(25, 40))


def test_what_is_lost_within_a_round_trip_of_a_request_is_no_answer(played: Played) -> None:
    played.rtt_ms, played.until_s = 300.0, 104.0
    send(played, 120, lose=hit(last=110))
    played.run(on_picture_lost=played.request)
    steps = [b - a for a, b in pairwise(played.requests_s)]
    assert len(steps) >= 2
    assert min(steps) >= 0.3


def test_where_no_request_is_made_the_connection_is_made_anew(played: Played) -> None:
    """An older robot, or one whose gateway does not answer."""
    send(played, 200, lose=lambda frame, packet: frame >= 7 and packet == 1)
    played.takes_requests = False
    found = played.run(on_picture_lost=played.request)
    assert played.now_s == pytest.approx(100 + 7 / 30 + FIRST_WAIT_S + 0.2, abs=0.03)
    assert found.rejoins == 1


def test_where_a_request_fails_the_connection_is_made_anew_at_once(played: Played) -> None:
    """The answer comes 50 ms later: not allowed, for example."""
    send(played, 200, lose=lambda frame, packet: frame >= 7 and packet == 1)

    def takes_requests() -> bool:
        failed = played.requests_s and played.now_s > played.requests_s[0] + 0.05
        played.takes_requests = not failed
        return not failed

    found = played.run(on_picture_lost=played.request, takes_requests=takes_requests)
    assert played.now_s == pytest.approx(100 + 7 / 30 + FIRST_WAIT_S + 0.2, abs=0.03)
    assert found.rejoins == 1


def test_without_a_request_the_connection_is_made_anew(played: Played) -> None:
    send(played, 200, lose=lambda frame, packet: frame >= 7 and packet == 1)
    found = played.run()
    assert played.now_s == pytest.approx(100 + 7 / 30 + FIRST_WAIT_S + 0.2, abs=0.03)
    assert found.rejoins == 1


def test_joining_between_key_frames_requests_none_at_once(played: Played) -> None:
    send(played, 60, lose=lambda frame, _packet: frame == 0)
    played.run(on_picture_lost=played.request)
    assert played.shown[0] == 5
    assert played.requests_s == []


def test_a_decoder_that_is_too_slow_skips_to_a_key_frame(played: Played) -> None:
    send(played, 30)
    played.full_until_s = 100.45
    found = played.run(on_picture_lost=played.request)
    assert played.shown == list(range(15, 30))
    assert played.units[0].first
    assert found.dropped_frames == 15
    assert played.requests_s == [], "another key frame makes it no faster"
    assert found.rejoins == 0


@pytest.mark.parametrize("clock", [True, False], ids=["by the robot's clock", "by what has grown"])
def test_the_age_of_the_frames_is_bounded(played: Played, clock: bool) -> None:
    """A link that is narrower than the stream: each frame comes 20 ms later than it should."""
    send(played, 120, delay_s=lambda frame: 0.02 * frame)
    capture = CaptureClock(0, lambda: int((played.now_s - 100.0) * 1e9)) if clock else None
    found = played.run(capture=capture, max_age_s=1.0)
    assert found.rejoins == 1
    newest_s = played.shown[-1] / 30
    assert played.now_s - 100.0 - newest_s == pytest.approx(1.0, abs=0.06)


def repaired(played: Played, of_frames: range, after_s: float) -> None:
    """Sends frames, of some of which the second payload comes so much later than the others."""
    send(played, 60, lose=lambda frame, index: frame in of_frames and index == 1)
    on_time = played.packets
    played.packets = deque()
    send(played, 60)
    lost = [each for each in played.packets if each not in on_time]
    again = [(arrival_s + after_s, number, payload) for arrival_s, number, payload in lost]
    played.packets = deque(sorted([*on_time, *again]))


def test_frames_that_are_old_because_something_was_lost_may_still_come(played: Played) -> None:
    """Those of now are there already, and the last packet that is missing comes 0.1 s later."""
    repaired(played, range(20, 24), after_s=0.4)
    found = played.run(max_age_s=0.3)
    assert played.shown == list(range(60))
    assert (found.rejoins, found.given_up) == (0, 0)


def test_frames_that_stay_old_because_of_losses_are_waited_for_no_longer(played: Played) -> None:
    repaired(played, range(20, 60), after_s=0.4)
    assert played.run(max_age_s=0.3).rejoins == 1
    assert played.now_s == pytest.approx(100.0 + 20 / 30 + 0.4 + 0.2, abs=0.06)


@pytest.mark.parametrize("clock", [True, False], ids=["by the robot's clock", "by what has grown"])
def test_a_wrap_of_the_pts_is_no_age(played: Played, clock: bool) -> None:
    """It comes every 26.5 h."""
    first_ticks = WRAP_TICKS - 30 * TICKS
    send(played, 60, first_ticks=first_ticks)
    first_ns = ticks_to_ns(first_ticks)
    capture = CaptureClock(0, lambda: first_ns + int((played.now_s - 100.0) * 1e9)) if clock else None
    found = played.run(capture=capture)
    assert found.rejoins == 0
    assert [unit.pts_ticks for unit in played.units[29:31]] == [WRAP_TICKS - TICKS, 0]
    assert len(played.units) == 60


@pytest.mark.parametrize("clock", [True, False], ids=["by the robot's clock", "by what has grown"])
def test_over_a_wrap_of_the_pts_the_age_is_bounded_as_ever(played: Played, clock: bool) -> None:
    first_ticks = WRAP_TICKS - 30 * TICKS
    send(played, 120, delay_s=lambda frame: 0.02 * frame, first_ticks=first_ticks)
    first_ns = ticks_to_ns(first_ticks)
    capture = CaptureClock(0, lambda: first_ns + int((played.now_s - 100.0) * 1e9)) if clock else None
    assert played.run(capture=capture, max_age_s=1.0).rejoins == 1
    newest_s = (len(played.units) - 1) / 30
    assert played.now_s - 100.0 - newest_s == pytest.approx(1.0, abs=0.06)


def test_a_burst_after_an_outage_is_no_age(played: Played) -> None:
    """What has waited for two seconds comes at once, up to a frame of now."""
    send(played, 90, delay_s=lambda frame: max(0.0, 2.0 - frame / 30) if frame < 60 else 0.0)
    played.packets = deque(sorted(played.packets))
    assert played.run().rejoins == 0
    assert played.shown == list(range(90))


def test_the_recording_gets_the_packets_in_order(played: Played) -> None:
    send(played, 10)
    sent = [payload for _, _, payload in played.packets]
    played.packets[3], played.packets[4] = (
        (played.packets[3][0], *played.packets[4][1:]),
        (played.packets[4][0], *played.packets[3][1:]),
    )
    played.run()
    assert played.payloads == sent


def test_figures_of_earlier_connections_are_kept(played: Played) -> None:
    totals = Delivery(kind=DeliveryChoice.DIRECT, lost=10, given_up=2, dropped_frames=5, rejoins=1)
    send(played, 3)
    Reception(played, played, ReceiverOptions(), totals, played.reports.append).run(played.stopping)
    found = played.reports[-1]
    assert (found.lost, found.given_up, found.dropped_frames, found.rejoins) == (13, 2, 5, 1)


@pytest.mark.parametrize(("rtt_ms", "expected_s"), [(0, 0.2), (20, 0.25), (80, 0.55), (1000, 0.6)])
def test_the_wait_follows_the_round_trip_within_bounds(rtt_ms: float, expected_s: float) -> None:
    assert wait_s(rtt_ms) == pytest.approx(expected_s)


def test_on_a_link_that_loses_a_part_of_every_frame_the_connection_is_made_anew(played: Played) -> None:
    """One that is narrower than the stream: key frames are asked for in vain."""
    send(played, 300, lose=lambda frame, packet: frame >= 60 and packet % 2 == 1)
    played.lost_share = 0.5
    found = played.run(on_picture_lost=played.request)
    assert played.shown == list(range(60))
    assert found.rejoins == 1
    assert played.now_s == pytest.approx(100 + 60 / 30 + 0.6 + played.rtt_ms / 1000, abs=0.05)


def test_a_stream_that_pauses_is_not_stuck(played: Played) -> None:
    send(played, 60)
    played.lost_share = 0.5
    assert played.run(on_picture_lost=played.request).rejoins == 0
    assert played.stopping.is_set(), "8 s after the last packet"


class Flood(Played):
    """A sender that always has a packet; with the one of this number the receiver is to end."""

    stops_at = 0

    def receive(self) -> tuple[int, bytes]:
        self.received += 1
        assert self.received < 100_000, "it is taken without end"
        if self.received == self.stops_at:
            self.stopping.set()
        return self.received - 1, self.packets[self.received % len(self.packets)][2]


@pytest.fixture
def flood(monkeypatch: pytest.MonkeyPatch) -> Flood:
    made = Flood()
    monkeypatch.setattr("console.receiver.reception.time.monotonic", lambda: made.now_s)
    send(made, 30)
    return made


def test_a_sender_that_never_pauses_does_not_keep_it_from_its_end(flood: Flood) -> None:
    flood.stops_at = 2000
    flood.run()
    assert flood.received == 2000


def test_a_sender_that_never_pauses_does_not_keep_it_from_its_reports(flood: Flood) -> None:
    flood.until_s = 100.1
    flood.run()
    assert len(flood.reports) > 1


def test_the_loss_of_the_last_second_is_reported(played: Played) -> None:
    send(played, 200)
    played.lost_share = 0.125
    played.until_s = 105.0
    played.run()
    assert played.reports[0].loss_percent is None
    assert played.reports[-1].loss_percent == pytest.approx(12.5, abs=0.5)
