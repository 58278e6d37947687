"""The meter on a clock that the test plays; the robot's is an hour ahead."""

from dataclasses import dataclass, field, replace

import pytest

from console.client import Offset, PictureDelivery
from console.receiver.delivery import Delivery, DeliveryChoice
from console.viewer.picture_meter import HISTORY_SLOTS, PictureMeter
from console.viewer.picture_reading import AgeCause
from tests.support.suspends import PlayedSuspends
from tests.unit.console.receiver.frames import frame

OFFSET_S = 3600.0


@dataclass
class Played:
    """Clock, link and meter."""

    now_s: float = 100.0
    offset: Offset | None = field(default_factory=lambda: Offset(OFFSET_S, 0.0015))
    delivery: Delivery | None = None
    received_s: float | None = None

    def __post_init__(self) -> None:
        self.meter = PictureMeter(
            lambda: self.offset, lambda: self.delivery, received=lambda: self.received_s
        )

    def show(self, age_ms: float, own_ms: float | None = None) -> None:
        """Shows a frame that was captured so long ago."""
        captured_ns = round((self.now_s + OFFSET_S) * 1e9 - age_ms * 1e6)
        received_s = None if own_ms is None else self.now_s - own_ms / 1000
        self.meter.shown(replace(frame(), capture_ns=captured_ns, received_s=received_s))


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Played:
    made = Played()
    monkeypatch.setattr("console.viewer.picture_meter.time.monotonic", lambda: made.now_s)
    return made


def test_the_age_is_from_capture_to_shown_with_the_clocks_error(played: Played) -> None:
    played.show(17.25)
    found = played.meter.reading()
    assert found.age_ms == pytest.approx(17.25, abs=1e-3)
    assert found.error_ms == pytest.approx(1.5)
    assert played.meter.robot_now_ns() == round(3700.0 * 1e9)
    assert played.meter.capture_ns() == round(3700.0 * 1e9 - 17.25e6)


def test_without_a_clock_or_a_capture_time_there_is_no_age(played: Played) -> None:
    played.meter.shown(frame())
    played.offset = None
    played.show(20)
    assert played.meter.reading().age_ms is None
    assert played.meter.robot_now_ns() is None
    assert played.meter.report() is None
    assert played.meter.summary() is None


def test_a_picture_that_is_gone_has_no_age(played: Played) -> None:
    played.show(20)
    played.meter.forget()
    assert played.meter.reading().age_ms is None
    assert played.meter.capture_ns() is None


def test_a_picture_from_the_future_has_no_age_but_one_within_the_clocks_error_has(played: Played) -> None:
    """After a suspend the offset is wrong until the next answer of the robot: 0 ms would be a lie."""
    played.show(-1.4)
    assert played.meter.reading().age_ms == 0
    played.show(-60_000)
    assert played.meter.reading().age_ms is None
    assert played.meter.capture_ns() is None
    assert played.meter.report() is None


def test_the_worst_age_since_the_last_report_is_reported(played: Played) -> None:
    played.delivery = Delivery(
        kind=DeliveryChoice.DIRECT, rtt_ms=20.4, loss_percent=1.5, waited=7, given_up=2
    )
    for age_ms in (20, 180, 30):
        played.show(age_ms)
        played.now_s += 0.03
    first = played.meter.report()
    assert first
    assert (first.picture_age_ms, first.picture_age_error_ms, first.rtt_ms) == (180, 2, 20)
    assert (first.loss_percent, first.packets_held, first.packets_given_up) == (1.5, 7, 2)
    assert first.delivery is PictureDelivery.DIRECT
    played.now_s += 0.03
    played.show(40)
    second = played.meter.report()
    assert second
    assert (second.picture_age_ms, second.viewer_id) == (40, first.viewer_id)


def test_a_frozen_picture_is_reported_with_its_age_now(played: Played) -> None:
    played.show(20)
    played.now_s += 2.5
    report = played.meter.report()
    assert report
    assert report.picture_age_ms == 2520
    played.now_s += 1e6
    report = played.meter.report()
    assert report
    assert report.picture_age_ms == 60_000


def test_a_freeze_that_has_ended_counts_with_the_age_at_its_end(played: Played) -> None:
    """Both pictures were young when they were shown; what the driver saw in between was not."""
    played.show(20)
    played.now_s += 0.9
    played.show(30)
    played.now_s += 0.05
    assert played.meter.worst_ms(0.5) == pytest.approx(920, abs=1)
    summary, report = played.meter.summary(), played.meter.report()
    assert summary
    assert report
    assert (summary.median_ms, summary.worst_ms) == (25.0, 920.0)
    assert (report.picture_age_ms, report.link_age_ms) == (920, 30)
    played.now_s += 0.05
    played.show(40)
    second = played.meter.report()
    assert second
    assert second.picture_age_ms == 40, "each freeze is reported once"
    played.now_s += 0.5
    assert played.meter.worst_ms(0.3) == pytest.approx(540, abs=1)


def test_a_picture_that_goes_after_a_freeze_counts_with_the_age_at_its_end(played: Played) -> None:
    played.show(20)
    played.now_s += 0.4
    played.meter.forget()
    played.now_s += 5.0
    summary = played.meter.summary()
    assert summary
    assert summary.worst_ms == 420.0


def test_a_picture_of_before_a_suspend_is_older_by_it(
    played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The monotonic clock stood still. It is no age of the link, which would lower the bit rate of all."""
    suspends = PlayedSuspends()
    monkeypatch.setattr("console.viewer.picture_meter.SuspendedTime", suspends)
    played.show(20)
    suspends.total_s += 4.0
    assert played.meter.reading().age_ms == pytest.approx(4020, abs=1e-3)
    assert played.meter.worst_ms(0.5) == pytest.approx(4020, abs=1e-3)
    report = played.meter.report()
    assert report
    assert (report.picture_age_ms, report.link_age_ms) == (4020, 20)
    played.show(30)
    assert played.meter.reading().age_ms == pytest.approx(30, abs=1e-3)


def test_time_on_this_computer_is_not_of_the_link(played: Played) -> None:
    """A slow decoder, and then one that hangs while pictures go on coming; at last none come any more."""
    played.show(700, own_ms=650)
    report = played.meter.report()
    assert report
    assert (report.picture_age_ms, report.link_age_ms) == (700, 50)
    played.now_s += 2.0
    played.received_s = played.now_s - 0.03
    report = played.meter.report()
    assert report
    assert (report.picture_age_ms, report.link_age_ms) == (2700, 50)
    assert played.meter.reading().cause is AgeCause.DECODER
    played.now_s += 1.0
    report = played.meter.report()
    assert report
    assert (report.picture_age_ms, report.link_age_ms) == (3700, 1080)
    assert played.meter.reading().cause is AgeCause.LINK


def test_two_viewers_have_two_names(played: Played) -> None:
    other = Played(played.now_s)
    for each in (played, other):
        each.show(20)
    reports = played.meter.report(), other.meter.report()
    assert all(reports)
    assert len({report.viewer_id for report in reports if report}) == 2


def test_the_history_has_the_largest_age_of_each_half_second(played: Played) -> None:
    for age_ms in (20, 90, 30):
        played.show(age_ms)
    played.meter.forget()
    played.now_s += 1.0
    played.show(40)
    history = played.meter.history()
    assert len(history) == HISTORY_SLOTS
    assert history[-3:] == [pytest.approx(90, abs=1e-3), None, pytest.approx(40, abs=1e-3)]
    assert set(history[:-3]) == {None}
    played.meter.forget()
    played.now_s += 1000.0
    assert set(played.meter.history()) == {None}


def test_the_history_rises_while_a_picture_stands_still(played: Played) -> None:
    played.show(20)
    played.now_s += 1.25
    standing = [pytest.approx(each, abs=1e-3) for each in (520, 1020, 1270)]
    assert played.meter.history()[-3:] == standing
    played.show(30)
    assert played.meter.history()[-3:] == standing, "and has risen when the next one comes"
    played.now_s += 0.5
    assert played.meter.history()[-1] == pytest.approx(530, abs=1e-3)
    played.now_s += 1000.0
    assert None not in played.meter.history()


def test_the_worst_age_of_a_moment_has_short_peaks_and_what_is_frozen(played: Played) -> None:
    assert played.meter.worst_ms(0.5) is None
    for age_ms in (300, 20, 90, 30):
        played.show(age_ms)
        played.now_s += 0.2
    assert played.meter.worst_ms(0.3) == pytest.approx(290, abs=1), "90 ms old, and 0.2 s on the screen"
    assert played.meter.worst_ms(0.1) == pytest.approx(230, abs=1), "30 ms old 0.2 s ago, and no newer one"
    assert played.meter.worst_ms(0.9) == pytest.approx(500, abs=1)
    played.meter.forget()
    assert played.meter.worst_ms(0.5) is None


def test_the_summary_has_the_freeze_that_lasts_and_none_of_before_its_pictures(played: Played) -> None:
    played.show(20)
    played.now_s += 5.0
    for _ in range(3601):
        played.show(30)
    summary = played.meter.summary()
    assert summary
    assert summary.worst_ms == 30.0
    played.now_s += 2.0
    summary = played.meter.summary()
    assert summary
    assert summary.worst_ms == 2030.0


def test_the_summary_has_percentiles(played: Played) -> None:
    for number in range(100):
        played.show(10 + number)
    found = played.meter.summary()
    assert found
    assert (found.median_ms, found.worst_ms, found.error_ms) == (59.5, 109.0, 1.5)
    assert found.p95_ms == pytest.approx(104, abs=1)
    assert found.last_ms == 109.0
    assert found.cause is None
    played.show(12.34)
    played.now_s += 2.0
    found = played.meter.summary()
    assert found
    assert found.last_ms == 12.3, "as it was shown; how long it stood is in the worst"


def test_one_picture_is_its_own_percentile(played: Played) -> None:
    played.show(200, own_ms=190)
    found = played.meter.summary()
    assert found
    assert (found.median_ms, found.p95_ms, found.worst_ms, found.last_ms) == (200, 200, 200, 200)
    assert found.cause is not None


def test_many_pictures_take_no_more_memory(played: Played) -> None:
    for _ in range(10_000):
        played.show(20)
    assert len(played.meter._pictures()) == 3600
