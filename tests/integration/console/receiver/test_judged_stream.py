"""What the preview service sends, before independent judges."""

from pathlib import Path

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.judges import complaints, decoded_frames
from tests.support.mpegts import CLOCK_LIMIT_MS, analyse, share_of_the_limits
from tests.support.promise import MS, keeps
from tests.support.recording import record
from tests.support.running_preview import RunningPreview

pytestmark = [pytest.mark.gst, pytest.mark.timed, pytest.mark.alone]

SECONDS = 4


@pytest.mark.parametrize(
    ("encoder", "codec", "profile"),
    [
        ("x264", "h264", pb.PROFILE_LOW_BW),
        ("x264", "h264", pb.PROFILE_BALANCED),
        ("x264", "h264", pb.PROFILE_HIGH_QUALITY),
        ("x265", "h265", pb.PROFILE_BALANCED),
    ],
)
def test_the_judges_have_nothing_to_say(
    tmp_path: Path, encoder: str, codec: str, profile: "pb.Profile.ValueType"
) -> None:
    settings = {"encoders": {"order": [encoder], "key_frame_interval_s": 1}}
    with RunningPreview(tmp_path, settings) as preview:
        preview.enable(profile)
        preview.running()
        recording = b""

        def of_its_limit() -> float:
            nonlocal recording
            recording = record(preview.port, SECONDS)
            return share_of_the_limits(analyse(recording))

        keeps(
            1.0,
            "longest distance of clocks and tables, of its limit",
            of_its_limit,
            per_stalled_s=MS / CLOCK_LIMIT_MS,
        )
    stream = analyse(recording)
    assert stream.codec == codec
    assert stream.counter_gaps == []
    assert stream.broken_tables == 0
    assert stream.access_units[0].key, "a viewer that joins begins with a key frame"
    keys = [frame for frame in stream.access_units if frame.key]
    assert len(keys) >= SECONDS - 1
    assert all(frame.headed for frame in keys)
    assert all(frame.sized for frame in stream.access_units)
    file = tmp_path / "recording.ts"
    file.write_bytes(recording[: stream.whole_bytes])
    assert complaints(file) == ""
    assert decoded_frames(file) == len(stream.access_units) - 1
