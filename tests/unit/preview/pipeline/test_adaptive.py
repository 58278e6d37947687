"""The bit rate controller on simulated links."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from preview.pipeline.adaptive import BitrateController, LinkReport


def link(
    rtt_ms: float = 10.0, loss: float = 0.0, retransmitted: float = 0.0, dropped: float = 0.0
) -> LinkReport:
    return LinkReport(rtt_ms, loss, retransmitted, dropped)


QUIET = link()


def settled(controller: BitrateController, now: float = 0.0) -> float:
    for _ in range(4):
        controller.decide(QUIET, now)
        now += 0.5
    return now


def test_a_quiet_link_gets_the_target() -> None:
    controller = BitrateController(2500, 500)
    for step in range(20):
        decision = controller.decide(QUIET, step * 0.5)
        assert (decision.bitrate_kbps, decision.reason) == (2500, "")


@pytest.mark.parametrize(
    ("congested", "signs"),
    [
        (link(rtt_ms=180), "RTT 180 ms"),
        (link(loss=12), "12 % loss"),
        (link(retransmitted=20), "20 % sent again"),
        (link(dropped=2), "2.0 % too late to send"),
        (link(rtt_ms=180, loss=12), "RTT 180 ms, 12 % loss"),
    ],
)
def test_a_congested_link_gets_less_at_once(congested: LinkReport, signs: str) -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    decision = controller.decide(congested, now)
    assert decision.bitrate_kbps == 1750
    assert decision.reason == f"{signs}: 2500 -> 1750 kbit/s"


def test_a_little_random_loss_is_left_to_srt() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    lossy = link(loss=3, retransmitted=4)
    for step in range(20):
        assert controller.decide(lossy, now + step * 0.5).bitrate_kbps == 2500


def test_it_falls_to_the_floor_and_says_so() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    for step in range(40):
        decision = controller.decide(link(dropped=5), now + step * 0.5)
    assert decision.bitrate_kbps == 500
    assert "at the floor of 500 kbit/s" in decision.reason


def test_one_bad_window_is_one_step() -> None:
    """The next windows still carry what was sent before the step."""
    controller = BitrateController(2500, 500)
    now = settled(controller)
    bad = link(dropped=5)
    assert controller.decide(bad, now).bitrate_kbps == 1750
    assert controller.decide(bad, now + 0.5).bitrate_kbps == 1750
    assert controller.decide(bad, now + 1.0).bitrate_kbps == 1225


def test_it_climbs_slowly_back_to_the_target() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    controller.decide(link(dropped=5), now)
    rates = [controller.decide(QUIET, now + step * 0.5).bitrate_kbps for step in range(1, 60)]
    assert rates[0] == 1750
    steps = {after - before for before, after in pairwise(rates)}
    # Large steps up to 80 % of the rate that was too much, small ones from there.
    assert {0, 125, 31} <= steps
    assert max(after - before for before, after in pairwise(rates) if before >= 2000) == 31
    assert rates[-1] == 2500
    assert controller.decide(QUIET, now + 31).reason == ""


def test_it_climbs_after_three_quiet_seconds_by_a_step_a_second() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    assert controller.decide(link(dropped=5), now).bitrate_kbps == 1750
    assert controller.decide(QUIET, now + 2.5).bitrate_kbps == 1750
    assert controller.decide(QUIET, now + 3.0).bitrate_kbps == 1875
    assert controller.decide(QUIET, now + 3.5).bitrate_kbps == 1875, "one step a second"
    assert controller.decide(QUIET, now + 4.0).bitrate_kbps == 2000


def test_it_climbs_carefully_near_the_rate_that_was_too_much_last() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    for step in range(2):
        controller.decide(link(dropped=5), now + step)
    rates = [controller.decide(QUIET, now + step).bitrate_kbps for step in range(3, 10)]
    # 80 % of 1750 is 1400, and of 2500 it is 2000.
    assert rates == [1225, 1350, 1475, 1506, 1537, 1568, 1599]


def test_where_hardly_anything_gets_through_the_rate_is_halved() -> None:
    for severe in (link(loss=40), link(dropped=30)):
        controller = BitrateController(2500, 500)
        now = settled(controller)
        assert controller.decide(severe, now).bitrate_kbps == 1250


def test_a_round_trip_that_is_always_long_is_no_congestion() -> None:
    controller = BitrateController(2500, 500)
    for step in range(40):
        assert controller.decide(link(rtt_ms=250), step * 0.5).bitrate_kbps == 2500


def test_a_round_trip_that_stays_longer_becomes_the_usual_one() -> None:
    """1.02 a window: from 10 ms it takes 106 windows until 200 ms are no more than 2.5 times as long."""
    controller = BitrateController(2500, 500)
    now = settled(controller)
    rates = [controller.decide(link(rtt_ms=200), now + step * 0.5).bitrate_kbps for step in range(250)]
    assert rates[100] == 500
    assert rates[-1] == 2500


def test_a_short_round_trip_may_grow_by_40_ms() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    assert controller.decide(link(rtt_ms=49), now).bitrate_kbps == 2500
    assert controller.decide(link(rtt_ms=55), now + 0.5).bitrate_kbps == 1750


def test_the_round_trip_of_the_viewer_before_does_not_count() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    controller.decide(None, now)
    assert controller.decide(link(rtt_ms=250), now + 0.5).bitrate_kbps == 2500


def test_without_viewers_the_target_comes_back() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    controller.decide(link(dropped=5), now)
    assert controller.decide(None, now + 1).bitrate_kbps == 2500


def test_another_profile_begins_at_its_target() -> None:
    controller = BitrateController(2500, 500)
    now = settled(controller)
    controller.decide(link(dropped=5), now)
    controller.retarget(1000, 300)
    assert controller.decide(QUIET, now + 1).bitrate_kbps == 1000


_percent = st.floats(0, 100)
_links = st.builds(LinkReport, st.floats(0.1, 5000), _percent, _percent, _percent) | st.none()


@given(st.lists(_links, max_size=100), st.integers(100, 5000), st.integers(100, 5000))
def test_it_never_leaves_its_bounds(links: list[LinkReport | None], target: int, floor: int) -> None:
    controller = BitrateController(target, floor)
    for step, report in enumerate(links):
        decision = controller.decide(report, step * 0.5)
        assert min(floor, target) <= decision.bitrate_kbps <= target
        assert "\n" not in decision.reason
        assert (decision.reason == "") <= (decision.bitrate_kbps == target)
