"""Two minutes in slots: gaps stay gaps, old values leave, scales are round."""

import pytest

from console.monitor.history import METRICS, NOTHING, SLOTS, STEP_S, History, Metric, top_of_scale, values_of
from omniseer.gateway.v1 import overlay_pb2
from tests.support.snapshots import snapshot

ONE = (1.0,) * len(METRICS)
TWO = (2.0,) * len(METRICS)


def test_the_newest_value_is_the_last() -> None:
    history = History()
    history.record(1000.0, ONE)
    history.record(1000.5, TWO)
    assert history.series(0)[-2:] == [1.0, 2.0]
    assert history.series(0)[:-2] == [None] * (SLOTS - 2)


def test_time_without_records_is_a_gap() -> None:
    history = History()
    history.record(1000.0, ONE)
    history.record(1002.0, TWO)
    assert history.series(0)[-5:] == [1.0, None, None, None, 2.0]


def test_what_was_not_known_is_a_gap() -> None:
    history = History()
    for moment_s, values in ((1000.0, ONE), (1000.5, NOTHING), (1001.0, TWO)):
        history.record(moment_s, values)
    assert history.series(0)[-3:] == [1.0, None, 2.0]


def test_the_last_record_of_a_slot_counts() -> None:
    history = History()
    history.record(1000.0, ONE)
    history.record(1000.4, TWO)
    assert history.series(0)[-2:] == [None, 2.0]


def test_after_two_minutes_a_value_is_gone() -> None:
    history = History()
    history.record(1000.0, TWO)
    for slot in range(1, SLOTS):
        history.record(1000.0 + slot * STEP_S, ONE)
    assert history.series(0)[0] == 2.0
    history.record(1000.0 + SLOTS * STEP_S, ONE)
    assert history.series(0) == [1.0] * SLOTS


def test_a_computer_that_slept_for_an_hour_shows_nothing_old() -> None:
    history = History()
    for slot in range(SLOTS):
        history.record(1000.0 + slot * STEP_S, ONE)
    history.record(5000.0, TWO)
    assert history.series(0) == [None] * (SLOTS - 1) + [2.0]


@pytest.mark.parametrize(
    ("series", "top"),
    [
        ([], 30),
        ([None], 30),
        ([12.0, None], 30),
        ([30.0], 30),
        ([31.0], 40),
        ([250.0], 300),
        ([9999.0], 10_000),
    ],
)
def test_the_scale_ends_at_a_round_number(series: list[float | None], top: float) -> None:
    assert top_of_scale(Metric("rate", "fps", 0, 30), series) == top


def test_only_fresh_values_are_plotted() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        compute, measured = made.status.platform.compute, made.status.preview.measured
        compute.available, compute.cpu_percent = True, 34
        compute.cpu_temperature_available, compute.cpu_temperature_c = True, 51
        measured.available, measured.stale, measured.fps = True, True, 30

    assert values_of(83.0, snapshot(change).status) == (83.0, None, None, None, 34, 51)


def test_the_age_of_the_picture_needs_no_status() -> None:
    """The video goes on without the gateway."""
    assert values_of(83.0, None) == (83.0, *NOTHING[1:])
