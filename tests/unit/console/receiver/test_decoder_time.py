from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.capture_time import WRAP_TICKS, ns_to_ticks, ticks_to_ns
from console.receiver.decoder_time import DecoderTime

HALF = WRAP_TICKS // 2


@given(st.lists(st.integers(0, WRAP_TICKS - 1), min_size=1, max_size=50))
def test_whatever_a_sender_stamps_is_a_time_of_gstreamers(stamps: list[int]) -> None:
    times = DecoderTime()
    for stamp in stamps:
        time_ns = times.time_ns(stamp)
        assert 0 <= time_ns < 1 << 63
        assert ns_to_ticks(time_ns) % WRAP_TICKS == stamp


@pytest.mark.parametrize("step", [HALF, HALF - 1, HALF + 1])
def test_a_sender_that_jumps_with_every_frame_stays_within_them(step: int) -> None:
    """By half a wrap, which counts as backwards, and by a tick less or more; for hours at 60 frames/s."""
    times = DecoderTime()
    for number in range(500_000):
        assert 0 <= times.time_ns(number * step % WRAP_TICKS) < 1 << 63


def test_after_that_its_steps_are_true_again() -> None:
    times = DecoderTime()
    for number in range(10):
        times.time_ns(number * HALF % WRAP_TICKS)
    found = [times.time_ns(number * 90_000) for number in range(10)]
    assert [later - earlier for earlier, later in pairwise(found)] == [10**9] * 9


def test_a_stream_goes_on_over_the_wraps() -> None:
    times, hour_ticks = DecoderTime(), 3600 * 90_000
    found = [times.time_ns(hour * hour_ticks % WRAP_TICKS) for hour in range(100)]
    assert found == [ticks_to_ns(WRAP_TICKS + hour * hour_ticks) for hour in range(100)]
