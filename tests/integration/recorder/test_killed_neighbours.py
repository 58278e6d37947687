"""What a recording loses when the programs beside the recorder are killed: what they did not deliver."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.values import VIDEO_TOPIC
from tests.support.gateway_program import gateway_program
from tests.support.record_command import printed
from tests.support.running_preview import RunningPreview
from tests.support.running_recorder import RecorderProgram, recorder_program
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst]

TOPIC = "/odom"
FRAMES = 30


def written(program: RecorderProgram) -> int:
    return program.state.status.messages_written


@pytest.mark.usefixtures("ros_domain")
def test_a_killed_gateway_costs_a_recording_nothing_and_its_successor_ends_it(tmp_path: Path) -> None:
    from std_msgs.msg import Int64  # noqa: PLC0415

    from tests.support.publishing import publishing  # noqa: PLC0415

    with (
        recorder_program(tmp_path) as recorder,
        publishing(TOPIC, Int64) as talker,
    ):
        settings: dict[str, Any] = {"sources": [], "recording": {"socket": str(recorder.socket)}}
        with gateway_program(tmp_path, **settings) as gateway:
            wait_until(lambda: gateway.status().recording.presets, "the gateway has reached the recorder")
            recording_id = printed(gateway, "start")["recording"]["id"]
            wait_until(lambda: talker.heard, "the recorder has subscribed")
            talker.publish(100)
            gateway.process.kill()
            gateway.process.wait()
            talker.publish(100)
        wait_until(lambda: written(recorder) >= 200, "it records without a gateway")
        with gateway_program(tmp_path, **settings) as gateway:
            wait_until(
                lambda: gateway.status().recording.recording_id == recording_id,
                "the next gateway finds it running",
            )
            talker.publish(100)
            wait_until(lambda: written(recorder) >= 300, "300 messages")
            stopped = printed(gateway, "stop")["recording"]
        assert (stopped["id"], stopped["state"]) == (recording_id, "complete")
        assert (stopped["messages_lost"], stopped["gaps"]) == (0, [])
        found = recorder.decoded(recorder.recording(recording_id), TOPIC)
        assert [each.data for each in found] == list(range(1, 301))


@pytest.mark.usefixtures("ros_domain")
def test_a_killed_preview_costs_a_recording_its_frames_alone_and_the_file_says_so(tmp_path: Path) -> None:
    from std_msgs.msg import Int64  # noqa: PLC0415

    from tests.support.publishing import publishing  # noqa: PLC0415

    tap = tmp_path / "tap.sock"
    with (
        RunningPreview(tmp_path, {"video_tap": {"socket": str(tap)}}) as preview,
        recorder_program(tmp_path, video={"socket": str(tap)}) as recorder,
        publishing(TOPIC, Int64) as talker,
    ):
        start = pb.StartRecordingRequest(request_id="1", with_video=True)
        recording_id = recorder.call("StartRecording", start).recording.id
        wait_until(lambda: talker.heard, "the recorder has subscribed")

        def frames(more_than: int) -> bool:
            return int(recorder.recording(recording_id).video_frames) > more_than

        wait_until(partial(frames, FRAMES), "frames")
        preview.process.kill()
        preview.process.wait()
        talker.publish(100)
        before = recorder.recording(recording_id).video_frames
        preview.start_again()
        wait_until(partial(frames, before + FRAMES), "frames of the next preview")
        talker.publish(100)

        def numbers() -> int:
            found = recorder.recording(recording_id)
            return found.messages_written - found.video_frames

        wait_until(lambda: numbers() >= 200, "messages that are no frames")
        recorder.call("StopRecording", pb.StopRecordingRequest(request_id="2"))
        made = recorder.recording(recording_id)
        assert made.state == pb.RECORDING_STATE_COMPLETE
        assert made.messages_lost == 0
        assert pb.RECORDING_GAP_CAUSE_VIDEO in {gap.cause for gap in made.gaps}
        assert [each.data for each in recorder.decoded(made, TOPIC)] == list(range(1, 201))
        video = recorder.decoded(made, VIDEO_TOPIC)
        assert len(video) == made.video_frames
        stamps = [(each.timestamp.sec, each.timestamp.nanosec) for each in video]
        assert stamps == sorted(set(stamps))


@pytest.mark.usefixtures("ros_domain")
def test_a_preview_that_never_came_is_a_gap_of_the_whole_recording(tmp_path: Path) -> None:
    with recorder_program(tmp_path, video={"socket": str(tmp_path / "tap.sock")}) as recorder:
        start = pb.StartRecordingRequest(request_id="1", with_video=True)
        recording_id = recorder.call("StartRecording", start).recording.id
        recorder.call("StopRecording", pb.StopRecordingRequest(request_id="2"))
        made = recorder.recording(recording_id)
        assert (made.state, made.video_frames) == (pb.RECORDING_STATE_COMPLETE, 0)
        (gap,) = made.gaps
        assert gap.cause == pb.RECORDING_GAP_CAUSE_VIDEO
        assert made.started_unix_ms - 100 <= gap.began_unix_ms <= gap.ended_unix_ms <= made.ended_unix_ms
