"""What a file says of its video besides the frames: what its encoder was set to, each change, each gap."""

import time
from functools import partial
from pathlib import Path

import pytest

from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.preview.v1 import preview_service_pb2 as preview_pb
from recorder.values import VIDEO_TOPIC
from recorder.video.stream import CLOCK_NOTE, STREAM_NOTE
from tests.support.running_preview import RunningPreview
from tests.support.running_recorder import recorder_program
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst]

FRAMES = 30
NS_PER_S = 1_000_000_000


@pytest.mark.usefixtures("ros_domain")
def test_every_change_of_the_stream_is_in_the_file(tmp_path: Path) -> None:
    tap = tmp_path / "tap.sock"
    settings = {"video_tap": {"socket": str(tap)}, "encoders": {"order": ["va-h265", "x264"]}}
    with (
        RunningPreview(tmp_path, settings, doubles={"vah265enc": "later error:20"}) as preview,
        recorder_program(tmp_path, video={"socket": str(tap)}) as recorder,
    ):
        start = pb.StartRecordingRequest(request_id="1", with_video=True)
        recording_id = recorder.call("StartRecording", start).recording.id

        def frames(more_than: int) -> bool:
            return int(recorder.recording(recording_id).video_frames) > more_than

        wait_until(partial(frames, FRAMES), "frames of both encoders")
        preview.enable()
        preview.running(revision=preview.revision)
        preview.enable(preview_pb.PROFILE_LOW_BW)
        preview.wait_for(lambda a: a.stream.target_bitrate_kbps == 300, "the other profile")
        before = int(recorder.recording(recording_id).video_frames)
        wait_until(partial(frames, before + FRAMES), "frames of the other profile")
        recorder.call("StopRecording", pb.StopRecordingRequest(request_id="2"))
        made = recorder.recording(recording_id)
        streams, clocks = recorder.noted(made, STREAM_NOTE), recorder.noted(made, CLOCK_NOTE)
        gaps = recorder.noted(made, "gap")

    def changes(*names: str) -> list[tuple[str, ...]]:
        """What they were one after the other, while frames flowed."""
        values = [tuple(each[name] for name in names) for each in streams if each["state"] == "running"]
        return [each for at, each in enumerate(values) if at == 0 or values[at - 1] != each]

    assert changes("encoder", "codec") == [("va-h265", "h265"), ("x264", "h264")]
    assert changes("profile", "bitrate_kbps", "fps") == [("balanced", "600", "30"), ("low-bw", "300", "15")]
    assert {(each["topic"], each["cause"]) for each in gaps} == {(VIDEO_TOPIC, "video")}
    assert clocks
    offset_ns = time.time_ns() - time.monotonic_ns()
    for each in (*streams, *clocks):
        assert abs(int(each["realtime_ns"]) - int(each["monotonic_ns"]) - offset_ns) < NS_PER_S
