"""Tables and clock of the stream at unusual rates, and while the rate changes."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.mpegts import CLOCK_LIMIT_MS, Stream, analyse, share_of_the_limits
from tests.support.promise import MS, keeps
from tests.support.recording import record
from tests.support.running_preview import RunningPreview

pytestmark = [pytest.mark.gst, pytest.mark.timed, pytest.mark.alone]

SECONDS = 3
SWITCHES = ((pb.PROFILE_LOW_BW, 15), (pb.PROFILE_BALANCED, 30), (pb.PROFILE_LOW_BW, 15))


def in_order(stream: Stream) -> None:
    assert stream.counter_gaps == []
    assert stream.clock_times_ms == sorted(stream.clock_times_ms), "the clock never runs back"
    assert len(stream.access_units) > SECONDS


@pytest.mark.parametrize("fps", [10, 12, 19, 25])
def test_at_rates_of_ones_own(tmp_path: Path, fps: int) -> None:
    with RunningPreview(tmp_path, {"profiles": {"balanced": {"fps": fps}}}) as preview:
        preview.enable()
        preview.running()

        def of_its_limit() -> float:
            stream = analyse(record(preview.port, SECONDS))
            in_order(stream)
            return share_of_the_limits(stream)

        keeps(
            1.0,
            "longest distance of clocks and tables, of its limit",
            of_its_limit,
            per_stalled_s=MS / CLOCK_LIMIT_MS,
        )


def test_while_the_profile_changes(preview: RunningPreview) -> None:
    def measures(fps: int, actual: pb.ActualState) -> bool:
        return abs(actual.measurement.fps - fps) < fps / 5

    def longest_ms() -> float:
        """The longest distance of clocks, but for those of the switches, which are fewer than two each."""
        preview.disable()
        preview.disabled()
        preview.enable(pb.PROFILE_HIGH_QUALITY)
        preview.running()
        with ThreadPoolExecutor(1) as viewer:
            recording = viewer.submit(record, preview.port, 2 * SECONDS)
            preview.wait_for(lambda a: a.measurement.viewer_count == 1, "a viewer")
            for profile, fps in SWITCHES:
                preview.enable(profile)
                preview.wait_for(partial(measures, fps), f"{fps} fps")
            stream = analyse(recording.result())
        in_order(stream)
        between_ms = [later - sooner for sooner, later in pairwise(stream.clock_times_ms)]
        return sorted(between_ms)[-2 * len(SWITCHES)]

    keeps(CLOCK_LIMIT_MS, "ms between two clocks, the switches left out", longest_ms, per_stalled_s=MS)
