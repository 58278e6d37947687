"""The bit rate controller, on single observations and on simulated links."""

import math
from dataclasses import dataclass
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.units import bit_rate
from preview.pipeline.adaptive import BitrateController, Decision, Sample, ViewerLink

WINDOW_S = 0.5
TARGET, FLOOR = 4500, 800
START = 800
RISING = [START, 1200, 1200, 1800, 1800, 2500]
"""After each window, on a quiet link: a step shows in the second one after it."""


def sample(
    rtt_ms: float = 10.0,
    loss: float = 0.0,
    dropped: float = 0.0,
    age_ms: float | None = None,
    stream_kbps: float = 10_000,
) -> Sample:
    return Sample(stream_kbps, {"viewer": ViewerLink(rtt_ms, loss, dropped)}, age_ms)


QUIET = sample()
NO_VIEWER = Sample(2500, {})
CONGESTED = sample(dropped=2)


class Run:
    """A controller, and the time of its windows."""

    def __init__(self, target: int = 2500, floor: int = 500) -> None:
        self.controller = BitrateController(target, floor)
        self.now = 0.0

    def after(self, *samples: Sample) -> Decision:
        """Returns the decision after these windows."""
        for each in samples:
            decision = self.controller.decide(each, self.now)
            self.now += WINDOW_S
        return decision

    def rates(self, seconds: float, each: Sample = QUIET) -> list[int]:
        return [self.after(each).bitrate_kbps for _ in range(round(seconds / WINDOW_S))]


@pytest.fixture
def settled() -> Run:
    run = Run()
    run.rates(5)
    return run


def test_it_starts_low_and_a_quiet_link_gets_the_target_soon() -> None:
    run = Run()
    assert run.controller.connect(0.0).bitrate_kbps == START
    assert run.rates(10) == [*RISING, *[2500] * 14]
    assert run.after(QUIET) == Decision(2500)


def test_a_target_below_the_start_is_the_start() -> None:
    run = Run(700, 300)
    assert run.controller.connect(0.0) == Decision(700)
    assert set(run.rates(5)) == {700}


def test_a_floor_above_the_start_is_the_start() -> None:
    assert Run(2500, 2500).controller.connect(0.0) == Decision(2500)


def test_without_a_viewer_it_is_the_target() -> None:
    """A recording has all of it."""
    run = Run()
    assert set(run.rates(30, NO_VIEWER)) == {2500}
    assert run.rates(3) == RISING


def test_a_viewer_that_has_connected_is_waited_for() -> None:
    """It is in the statistics of the next window at the earliest."""
    run = Run()
    assert run.controller.connect(run.now) == Decision(START)
    assert set(run.rates(2, NO_VIEWER)) == {START}
    assert run.rates(3) == RISING


def test_another_viewer_changes_nothing(settled: Run) -> None:
    assert settled.controller.connect(settled.now).bitrate_kbps == 2500


def test_the_start_ends_at_the_first_sign_of_a_queue() -> None:
    run = Run(TARGET, FLOOR)
    assert run.after(*[QUIET] * 4).bitrate_kbps == 1800
    assert run.after(sample(rtt_ms=25)).bitrate_kbps == 1800, "a queue may have begun"
    assert not run.controller.is_urgent({"viewer": 28.0}, run.now)
    assert run.controller.is_urgent({"viewer": 31.0}, run.now)
    back = run.after(sample(rtt_ms=31))
    assert back == Decision(1200, "RTT 31 ms: 1.80 Mbit/s -> 1.20 Mbit/s"), "what the link has carried"
    assert not run.controller.is_urgent({"viewer": 31.0}, run.now + 5)
    assert max(run.rates(6)) <= math.sqrt(1200 * 1800), "from there on it rises carefully"


def test_a_queue_at_the_start_itself_is_congestion_like_any_other() -> None:
    run = Run(TARGET, 300)
    run.after(QUIET)
    assert not run.controller.is_urgent({"viewer": 31.0}, run.now), "no step has made it"
    assert run.after(sample(rtt_ms=125, stream_kbps=800)).bitrate_kbps < START


def test_the_start_on_a_narrow_link_makes_no_old_pictures() -> None:
    """From the target on, 4500 kbit/s, the first second alone left two more in the queue."""
    controller, link = BitrateController(TARGET, FLOOR), Link(1500, queue_ms=None)
    ages, rate = [], controller.connect(0.0).bitrate_kbps
    for step in range(40):
        report = link.carry(rate)
        rate = controller.decide(report, step * WINDOW_S).bitrate_kbps
        ages.append(report.age_ms or 0.0)
    assert max(ages) < 800


@pytest.mark.parametrize(
    ("congested", "signs"),
    [
        (sample(rtt_ms=180), "RTT 180 ms"),
        (sample(loss=60), "30 % loss"),
        (sample(dropped=2), "2.0 % too late to send"),
        (sample(rtt_ms=180, dropped=2), "RTT 180 ms, 2.0 % too late to send"),
    ],
)
def test_a_congested_link_gets_less_at_once(settled: Run, congested: Sample, signs: str) -> None:
    decision = settled.after(congested)
    assert decision.bitrate_kbps <= 2500 * 0.85
    assert decision.reason == f"{signs}: 2.50 Mbit/s -> {bit_rate(decision.bitrate_kbps)}"


@pytest.mark.parametrize("loss", [3, 10, 15])
def test_loss_that_srt_repairs_is_left_to_it(settled: Run, loss: float) -> None:
    assert set(settled.rates(60, sample(loss=loss))) == {2500}


def test_one_window_of_heavy_loss_is_an_accident(settled: Run) -> None:
    settled.after(sample(loss=35))
    assert settled.after(QUIET).bitrate_kbps == 2500


def test_the_rate_falls_below_what_was_delivered(settled: Run) -> None:
    """The round trip grew by 200 ms in 500: 40 % more was sent than delivered."""
    settled.after(sample(stream_kbps=2500))
    assert settled.after(sample(rtt_ms=210, stream_kbps=2500)).bitrate_kbps == round(2500 * 0.6 * 0.85)


def test_an_encoder_that_sends_less_than_it_may_is_taken_at_what_it_sends(settled: Run) -> None:
    assert settled.after(sample(dropped=2, stream_kbps=1000)).bitrate_kbps == 850


def test_it_falls_to_the_floor_and_says_so(settled: Run) -> None:
    decision = settled.after(*[sample(dropped=5)] * 40)
    assert decision.bitrate_kbps == 500
    assert "at the floor of 500 kbit/s" in decision.reason


def test_one_bad_window_is_one_step(settled: Run) -> None:
    """The next windows still carry what was sent before the step."""
    rates = [settled.after(CONGESTED).bitrate_kbps for _ in range(3)]
    assert rates == [2125, 2125, round(2125 * 0.85)]


def test_while_the_queue_drains_the_rate_stays(settled: Run) -> None:
    lowered = settled.after(sample(rtt_ms=400))
    assert settled.after(*(sample(rtt_ms=400 - 25 * step) for step in range(1, 14))) == lowered


def test_a_queue_that_stays_needs_less(settled: Run) -> None:
    lowered = settled.after(sample(rtt_ms=400))
    assert settled.after(*[sample(rtt_ms=400)] * 4).bitrate_kbps < lowered.bitrate_kbps


def test_it_waits_close_to_the_rate_that_was_too_much(settled: Run) -> None:
    congested = settled.after(CONGESTED).bitrate_kbps
    rates = settled.rates(40)
    assert congested == 2125
    # Large steps up to 90 % of 2500, a wait, small steps from there.
    assert rates.count(2250) * WINDOW_S >= 4
    above = rates[rates.index(2250) :]
    assert 0 < max(after - before for before, after in pairwise(above)) <= 2500 * 0.025
    assert rates[-1] == 2500
    assert settled.after(QUIET).reason == ""


def test_each_failed_attempt_makes_the_next_wait_longer(settled: Run) -> None:
    waits = []
    settled.after(CONGESTED)
    for _ in range(7):
        begun, rate = settled.now, 0
        while True:
            before, rate = rate, settled.after(QUIET).bitrate_kbps
            if 0 < before < rate <= before * 1.03:
                break
        waits.append(settled.now - begun)
        settled.after(CONGESTED)
    assert all(after > before for before, after in pairwise(waits[:5]))
    assert waits[-1] == pytest.approx(60, abs=10)


def test_an_increase_needs_two_calm_seconds_and_comes_once_a_second(settled: Run) -> None:
    # A queue that takes long to drain: the rate falls to half of what the link carries.
    low = settled.after(CONGESTED, sample(rtt_ms=1500), sample(rtt_ms=1500)).bitrate_kbps
    rates = settled.rates(4)
    assert low == 1062
    assert rates == [1062] * 4 + [1187] * 2 + [1312] * 2


def test_a_round_trip_that_is_always_long_is_no_congestion() -> None:
    assert Run().rates(20, sample(rtt_ms=250)) == Run().rates(20)


def test_a_round_trip_that_stays_longer_becomes_the_usual_one(settled: Run) -> None:
    """4 % a second: from 10 ms it takes 70 s until 200 ms are no more than 1.5 times as long."""
    rates = settled.rates(250, sample(rtt_ms=200))
    assert rates[40] == 500
    assert rates[-1] == 2500


def test_a_short_round_trip_may_grow_by_40_ms(settled: Run) -> None:
    assert settled.after(sample(rtt_ms=49)).bitrate_kbps == 2500
    assert settled.after(sample(rtt_ms=55)).bitrate_kbps < 2500


def test_the_round_trip_of_the_viewer_before_does_not_count(settled: Run) -> None:
    settled.after(NO_VIEWER)
    assert settled.after(sample(rtt_ms=250)).bitrate_kbps == 2500


def test_a_viewer_further_away_is_no_queue(settled: Run) -> None:
    near = ViewerLink(10)
    for _ in range(10):
        both = Sample(2500, {"viewer": near, "another": ViewerLink(300)})
        assert settled.after(both).bitrate_kbps == 2500
    worse = Sample(2500, {"viewer": near, "another": ViewerLink(500)})
    assert settled.after(worse).reason.startswith("RTT 500 ms")


def test_pictures_that_grow_old_are_congestion_before_anything_is_lost(settled: Run) -> None:
    settled.after(*[sample(age_ms=60)] * 4)
    assert settled.after(sample(age_ms=200)).bitrate_kbps == 2500, "150 ms more may be a repair"
    decision = settled.after(sample(age_ms=450))
    # Half of it arrived, and about 390 ms wait.
    assert decision.bitrate_kbps == pytest.approx(2500 * 0.5 * (1 - 0.385 / 2), abs=2)
    assert decision.reason.startswith("pictures 450 ms old: 2.50 Mbit/s -> ")


def test_pictures_that_were_always_old_are_no_congestion() -> None:
    """A viewer with a long SRT latency of its own."""
    assert Run().rates(20, sample(age_ms=2000)) == Run().rates(20)


def test_the_age_is_judged_before_loss(settled: Run) -> None:
    settled.after(*[sample(age_ms=60)] * 4)
    assert settled.after(sample(age_ms=900, loss=80)).reason.startswith("pictures 900 ms old, 40 % loss")


def test_without_viewers_the_target_comes_back_after_a_while(settled: Run) -> None:
    settled.after(CONGESTED)
    lower = settled.rates(9, NO_VIEWER)
    assert max(lower) < 2500
    assert settled.rates(2, NO_VIEWER)[-1] == 2500
    assert settled.after(NO_VIEWER) == Decision(2500)
    assert settled.rates(3) == RISING, "another viewer's link is not known"


def test_a_viewer_that_joins_anew_finds_the_rate_that_it_left(settled: Run) -> None:
    before = settled.after(CONGESTED).bitrate_kbps
    settled.after(NO_VIEWER)
    again = Sample(2500, {"another port": ViewerLink(10.0)})
    assert settled.after(again).bitrate_kbps == before < 2500


def test_a_viewer_that_joins_anew_over_a_full_queue_has_the_minimum_of_before(settled: Run) -> None:
    def link(port: int, rtt_ms: float) -> Sample:
        return Sample(2500, {f"10.0.0.7:{port}": ViewerLink(rtt_ms)})

    settled.after(*[link(4000, 20)] * 4)
    lowered = settled.after(link(4000, 220)).bitrate_kbps
    settled.after(NO_VIEWER, NO_VIEWER)
    again = settled.after(link(4001, 220))
    assert again.bitrate_kbps < lowered
    assert again.reason.startswith("RTT 220 ms")


def test_a_queue_that_fills_fast_is_answered_within_the_window_and_by_half(settled: Run) -> None:
    controller, now = settled.controller, settled.now
    assert not controller.is_urgent({"viewer": 60.0}, now), "as long as a repair"
    assert not controller.is_urgent({"another": 600.0}, now), "its minimum is not known"
    assert controller.is_urgent({"viewer": 210.0}, now)
    # 200 ms in half a second: 60 % of the data arrives.
    decision = settled.after(sample(rtt_ms=210))
    assert decision.bitrate_kbps == pytest.approx(2500 * 0.6 * 0.5, abs=2)
    assert not controller.is_urgent({"viewer": 210.0}, settled.now - 0.2), "it takes a moment to show"
    assert not controller.is_urgent({"viewer": 150.0}, settled.now), "it drains"
    assert controller.is_urgent({"viewer": 210.0}, settled.now)


def test_heavy_loss_is_answered_by_its_own_size(settled: Run) -> None:
    """At the first sign: what is sent in the meantime has to be sent again, too."""
    assert settled.after(sample(loss=60)).bitrate_kbps == pytest.approx(2500 * 0.4 * 0.85, abs=2)


def test_another_profile_without_viewers_has_its_target() -> None:
    run = Run()
    run.controller.retarget(4500, 800)
    assert run.controller.decision == Decision(4500)


def test_another_profile_begins_with_what_the_links_have_carried(settled: Run) -> None:
    settled.controller.retarget(4500, 800)
    assert settled.controller.decision.bitrate_kbps == 2500
    assert settled.rates(2) == [3750, 3750, 4500, 4500]
    settled.controller.retarget(1000, 300)
    assert settled.controller.decision == Decision(1000)


@dataclass
class Link:
    """A bottleneck with a queue, in front of a viewer; what does not fit is lost.

    Without `queue_ms` the queue has no limit, as a sender's buffer with a viewer that waits for every packet:
    the round trip does not show it, the age of the pictures does.
    """

    capacity_kbps: float
    queue_ms: float | None = 200.0
    random_loss: float = 0.0
    waiting_ms: float = 0.0
    age_limit_ms: float = 60_000

    def carry(self, rate_kbps: float, window_s: float = WINDOW_S) -> Sample:
        sent_kbps = rate_kbps / (1 - self.random_loss)
        surplus_kbit = (sent_kbps - self.capacity_kbps) * window_s
        waiting_ms = max(0.0, self.waiting_ms + surplus_kbit / self.capacity_kbps * 1000)
        self.waiting_ms = min(waiting_ms, self.age_limit_ms if self.queue_ms is None else self.queue_ms)
        overflow = (waiting_ms - self.waiting_ms) / 1000 * self.capacity_kbps / (sent_kbps * window_s)
        loss = 100 * min(1.0, self.random_loss + overflow)
        if self.queue_ms is None:
            return Sample(rate_kbps, {"viewer": ViewerLink(40.0, loss)}, age_ms=60 + self.waiting_ms)
        return Sample(rate_kbps, {"viewer": ViewerLink(40.0 + self.waiting_ms, loss)})

    def carries(self, controller: BitrateController, seconds: float, start_s: float = 0.0) -> list[int]:
        """Returns the bit rates, window by window."""
        rates = []
        rate = controller.decide(self.carry(100), start_s).bitrate_kbps
        for step in range(1, round(seconds / WINDOW_S)):
            rate = controller.decide(self.carry(rate), start_s + step * WINDOW_S).bitrate_kbps
            rates.append(rate)
        return rates


@pytest.mark.parametrize("queue_ms", [200.0, 1500.0, None])
def test_it_settles_just_below_the_capacity(queue_ms: float | None) -> None:
    rates = Link(1500, queue_ms).carries(BitrateController(TARGET, FLOOR), 120)
    settled = rates[34:]
    assert sum(settled) / len(settled) > 1500 * 0.75
    over = [rate for rate in settled if rate > 1500]
    assert len(over) < len(settled) / 5, "rarely more than the link carries ..."
    assert max(over, default=0) < 1500 * 1.15, "... and never much more"


def test_pictures_do_not_grow_old_on_a_link_that_becomes_narrow() -> None:
    controller = BitrateController(TARGET, FLOOR)
    link = Link(100_000, queue_ms=None)
    link.carries(controller, 10)
    link.capacity_kbps = 1500
    ages = []
    rate = TARGET
    for step in range(40):
        report = link.carry(rate)
        rate = controller.decide(report, 10 + step * WINDOW_S).bitrate_kbps
        ages.append(report.age_ms or 0.0)
    assert max(ages) < 3000
    assert max(ages[20:]) < 400


def test_random_loss_on_a_wide_link_costs_nothing() -> None:
    rates = Link(100_000, random_loss=0.1).carries(BitrateController(TARGET, FLOOR), 60)
    assert set(rates[12:]) == {TARGET}


_capacities = st.floats(FLOOR * 1.2, TARGET * 2)


@given(_capacities, st.sampled_from([50.0, 200.0, 1000.0, None]), st.floats(0, 0.1))
def test_it_comes_back_to_the_profile_when_the_congestion_ends(
    capacity: float, queue_ms: float | None, loss: float
) -> None:
    controller = BitrateController(TARGET, FLOOR)
    link = Link(capacity, queue_ms, loss)
    link.carries(controller, 60)
    link.capacity_kbps = 100_000
    assert link.carries(controller, 180, 60)[-1] == TARGET


@given(st.lists(st.floats(10.1, 200), min_size=2, max_size=50), st.booleans())
def test_it_never_rises_while_a_delay_grows(growth_ms: list[float], of_age: bool) -> None:
    run = Run()
    run.after(*[CONGESTED] * 8, *[QUIET] * 12)
    delay_ms = 10.0
    run.after(sample(age_ms=delay_ms))
    rate = run.after(sample(age_ms=delay_ms)).bitrate_kbps
    for each in growth_ms:
        delay_ms += each
        before, rate = (
            rate,
            run.after(
                sample(age_ms=delay_ms) if of_age else sample(rtt_ms=delay_ms, age_ms=10.0)
            ).bitrate_kbps,
        )
        assert rate <= before


_percent = st.floats(0, 100)
_links = st.dictionaries(
    st.sampled_from("abc"), st.builds(ViewerLink, st.floats(0.1, 5000), _percent, _percent), max_size=3
)
_samples = st.builds(Sample, st.floats(0, 20_000), _links, st.none() | st.floats(0, 60_000))


@given(st.lists(_samples, max_size=100), st.integers(100, 5000), st.integers(100, 5000))
def test_it_never_leaves_its_bounds(samples: list[Sample], target: int, floor: int) -> None:
    run = Run(target, floor)
    decision = run.controller.decision
    for each in samples:
        before, decision = decision.bitrate_kbps, run.after(each)
        assert min(floor, target) <= decision.bitrate_kbps <= target
        assert "\n" not in decision.reason
        starts = decision.bitrate_kbps == max(min(floor, target), min(target, START))
        assert decision.reason or starts or before <= decision.bitrate_kbps


def test_a_higher_floor_lifts_a_rate_below_it_and_holds_it(settled: Run) -> None:
    settled.after(*[CONGESTED] * 40)
    settled.controller.set_floor(1500)
    decision = settled.after(CONGESTED)
    assert decision.bitrate_kbps == 1500
    assert min(settled.rates(20, CONGESTED)) == 1500
    settled.controller.set_floor(500)
    assert settled.rates(30, CONGESTED)[-1] == 500


def test_a_rate_that_a_recording_lifted_says_why(settled: Run) -> None:
    settled.after(*[CONGESTED] * 40)
    settled.controller.set_floor(1500)
    assert settled.after(NO_VIEWER).reason == "a recording holds it at 1.50 Mbit/s at least"


def test_a_floor_above_the_target_is_the_target(settled: Run) -> None:
    settled.controller.set_floor(9000)
    assert set(settled.rates(10, CONGESTED)) == {2500}
