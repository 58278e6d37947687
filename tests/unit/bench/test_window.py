"""What the video benchmarks compute of the frames that a viewer saw."""

import pytest

from bench.rows import MeasurementError
from bench.video.window import Glance, Glass, Window, delivered_of_due_percent, longest_gap_ms, slope


def glances(*times_s: tuple[float, float]) -> list[Glance]:
    return [Glance(captured_s, decoded_s) for captured_s, decoded_s in times_s]


def test_frames_count_by_their_capture_in_the_window() -> None:
    seen = glances((0.9, 1.1), (1.0, 1.2), (1.9, 2.4), (2.0, 2.1))
    assert [one.captured_s for one in Window.of(seen, 1.0, 2.0).glances] == [1.0, 1.9]


def test_torn_and_repeated_frames_are_not_delivered() -> None:
    seen = [Glance(1.0, 1.1), Glance(1.0, 1.3), Glance(1.2, 1.3, corrupt=True), Glance(1.4, 1.5)]
    window = Window.of(seen, 1.0, 2.0)
    assert window.delivered_percent(captured=4) == 50.0
    assert window.frames_per_s == 2.0
    assert window.glances[0].decoded_s == 1.1


def test_a_repaired_frame_counts_after_a_torn_one() -> None:
    seen = [Glance(1.0, 1.1, corrupt=True), Glance(1.0, 1.2)]
    assert len(Window.of(seen, 1.0, 2.0).glances) == 1


FRAME_NS = 10**9 / 60


def captured(*numbers: int) -> list[int]:
    """Capture times of these frames of a film at 60 frames/s, to the tick of 90 kHz."""
    return [10**15 + round(number * FRAME_NS / 11_111) * 11_111 for number in numbers]


def test_a_film_that_comes_whole_is_a_hundred_percent() -> None:
    assert delivered_of_due_percent(captured(*range(480)), 60, 8.0) == 100.0
    # In whatever order: what counts is when frames were captured, so a late first one adds nothing.
    assert delivered_of_due_percent(captured(3, 1, 2, 0), 60, 0.1) == 100.0


def test_frames_of_a_film_that_are_missing_are_not_made_good_by_those_that_come_twice() -> None:
    """The rate would not show it: as many came in the same time."""
    seen = [number for number in (*range(101), *range(50, 60)) if number % 10 != 5]
    assert delivered_of_due_percent(captured(*seen), 60, 1.7) == 90.0


def test_of_a_film_that_ends_too_early_there_is_no_share() -> None:
    with pytest.raises(MeasurementError, match=r"of 1\.0 s came in 8 s"):
        delivered_of_due_percent(captured(*range(61)), 60, 8.0)


@pytest.mark.parametrize("numbers", [(), (1,), (1, 1)])
def test_of_almost_no_frames_of_a_film_there_is_no_share(numbers: tuple[int, ...]) -> None:
    with pytest.raises(MeasurementError, match="nothing was measured"):
        delivered_of_due_percent(captured(*numbers), 60, 0.5)


def test_median_and_99th_percentile() -> None:
    window = Window.of(glances(*((n / 1000, n / 1000 + n / 1000) for n in range(1, 100))), 0.0, 1.0)
    assert window.median_ms == pytest.approx(50)
    assert window.p99_ms == pytest.approx(99)


@pytest.mark.parametrize(
    ("times_s", "longest_ms"),
    [
        ((), 1000),
        ((1.5,), 500),
        ((1.6, 1.1), 500),
        ((1.3, 1.6), 400),
        ((0.5, 1.05, 1.9, 2.5), 850),
    ],
)
def test_the_longest_gap_counts_the_edges(times_s: tuple[float, ...], longest_ms: float) -> None:
    seen = glances(*((decoded_s, decoded_s) for decoded_s in times_s))
    assert longest_gap_ms(seen, 1.0, 2.0) == pytest.approx(longest_ms)


def test_a_torn_frame_does_not_end_a_gap() -> None:
    assert longest_gap_ms([Glance(1.5, 1.5, corrupt=True)], 1.0, 2.0) == pytest.approx(1000)


def test_a_picture_grows_old_until_the_next_one() -> None:
    # Decoded after 100 ms each, at 1.0, 1.1 and 3.0: the second is 2 s old when the third comes.
    glass = Glass(glances((0.9, 1.0), (1.0, 1.1), (2.9, 3.0)), 0.0, 3.1)
    assert glass.worst_ms == pytest.approx(2000)
    # Only in the last 5 % of the 2.1 s was it older than that.
    assert glass.p95_ms == pytest.approx(2000 - 0.05 * 2100)


def test_the_end_counts_as_a_next_picture() -> None:
    assert Glass(glances((0.9, 1.0)), 0.0, 5.0).worst_ms == pytest.approx(4100)
    assert Glass(glances((0.9, 1.0), (7.0, 7.1)), 0.0, 5.0).worst_ms == pytest.approx(4100)


def test_only_the_time_from_the_begin_on_counts() -> None:
    seen = glances((0.1, 2.0), (2.0, 2.1), (2.1, 2.2))
    assert Glass(seen, 0.0, 2.3).worst_ms == pytest.approx(2000)
    assert Glass(seen, 2.15, 2.3).worst_ms == pytest.approx(200)
    # Both pictures are between 150 and 200 ms old at some time.
    assert Glass(seen, 2.15, 2.3).p95_ms == pytest.approx(200 - 0.05 * 150 / 2)


def test_a_torn_picture_is_none() -> None:
    seen = [Glance(0.9, 1.0), Glance(1.9, 2.0, corrupt=True), Glance(2.9, 3.0)]
    assert Glass(seen, 0.0, 3.05).worst_ms == pytest.approx(2100)


def test_without_any_picture_the_age_is_that_of_the_beginning() -> None:
    for nothing in (Glass((), 1.0, 13.0), Glass(glances((12.0, 13.5)), 1.0, 13.0)):
        assert nothing.worst_ms == pytest.approx(12000)
        assert nothing.p95_ms == pytest.approx(0.95 * 12000)


def test_slope_for_one_more_viewer() -> None:
    assert slope((1, 4, 16), (10.0 + 1 * 2, 10.0 + 4 * 2, 10.0 + 16 * 2)) == pytest.approx(2.0)
