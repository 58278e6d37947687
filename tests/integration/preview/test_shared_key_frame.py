"""Viewers that connect together share a key frame: requested ones are at least 300 ms apart."""

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.support.crowd import join
from tests.support.mpegts import analyse
from tests.support.recording import record
from tests.support.running_preview import RunningPreview
from tests.support.undisturbed import without_stall

pytestmark = pytest.mark.gst

APART_S = 0.3
"""Between requested key frames, as docs/preview.md promises."""
VIEWERS = 8
SECONDS = 6


@pytest.mark.timeout(240)
def test_viewers_that_join_within_300_ms_share_a_key_frame(tmp_path: Path) -> None:
    # In a stall the crowd's first bytes are noted late, and key frames are requested late.
    without_stall(share_a_key_frame, tmp_path)


def share_a_key_frame(directory: Path) -> None:
    # Only requested key frames come within the test.
    settings = {"encoders": {"key_frame_interval_s": 30}}
    with RunningPreview(directory, settings) as preview, ThreadPoolExecutor(1) as observer:
        preview.enable()
        preview.running()
        recording = observer.submit(record, preview.port, SECONDS)
        preview.wait_for(lambda a: a.measurement.viewer_count == 1, "the observer")
        crowd = join(preview.port, VIEWERS, apart_s=APART_S / VIEWERS)
        keys = [unit for unit in analyse(recording.result()).access_units if unit.key]
    joined_s = [seen.first_s for seen in crowd]
    intervals = math.ceil((max(joined_s) - min(joined_s)) / APART_S)
    # The observer's, one at once for the first of the crowd, and one in each of the following intervals.
    assert 1 < len(keys) <= 2 + intervals
    assert len(keys) < 1 + VIEWERS
    assert all(seen.key_frames for seen in crowd), "half a minute later the next one would come"
