"""From robotctl to the file on the operator's disk: gateway, recorder and preview are the real programs."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from recorder.values import VIDEO_TOPIC
from tests.support.gateway_program import gateway_program
from tests.support.gst_judge import decoded_frames
from tests.support.record_command import printed, record
from tests.support.robotctl import only_line
from tests.support.running_preview import RunningPreview
from tests.support.running_recorder import recorder_program
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst]

TOPIC = "/odom"
SENT = 200
FRAMES = 30


def exported_units(folder: Path) -> list[bytes]:
    """The access units of a copy in their order, as an independent reader of MCAP and ROS 2 finds them."""
    units: list[bytes] = []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
            for found in reader.iter_decoded_messages(topics=[VIDEO_TOPIC]):
                assert found.decoded_message.format == "h264"
                units.append(bytes(found.decoded_message.data))
    return units


@pytest.mark.usefixtures("ros_domain")
def test_a_recording_with_video_is_started_stopped_and_copied_by_robotctl(tmp_path: Path) -> None:
    from std_msgs.msg import Int64  # noqa: PLC0415

    from tests.support.publishing import publishing  # noqa: PLC0415

    tap = tmp_path / "tap.sock"
    with (
        RunningPreview(tmp_path, {"video_tap": {"socket": str(tap)}}),
        recorder_program(tmp_path, video={"socket": str(tap)}) as recorder,
        gateway_program(tmp_path, sources=[], recording={"socket": str(recorder.socket)}) as gateway,
        publishing(TOPIC, Int64) as talker,
    ):
        wait_until(lambda: gateway.status().recording.presets, "the gateway has reached the recorder")
        started = printed(gateway, "start", "--label", "lap 1", "--video")
        recording_id = started["recording"]["id"]
        wait_until(lambda: talker.heard, "the recorder has subscribed")
        talker.publish(SENT)
        wait_until(lambda: gateway.status().recording.video, "the video is recorded, and no one watches")
        wait_until(
            lambda: gateway.status().recording.messages_written >= SENT + FRAMES, "messages, and frames"
        )
        again = record(gateway, "start")
        assert again.returncode == 1
        assert "record stop" in only_line(again.stderr)
        stopped = printed(gateway, "stop")["recording"]
        assert (stopped["state"], stopped["messages_lost"]) == ("complete", 0)
        assert stopped["video_frames"] >= FRAMES
        copies = tmp_path / "copies"
        exported = record(gateway, "export", recording_id, "--to", str(copies))
        assert exported.returncode == 0, exported.stderr
        with Reader(copies / recording_id / "data") as bag:
            assert bag.topics[TOPIC].msgcount == SENT
            assert bag.topics[VIDEO_TOPIC].msgtype == "foxglove_msgs/msg/CompressedVideo"
            assert bag.topics[VIDEO_TOPIC].msgcount == stopped["video_frames"]
        units = exported_units(copies / recording_id / "data")
        assert decoded_frames(units) == len(units) == stopped["video_frames"], "by GStreamer"
        assert record(gateway, "delete", recording_id).returncode == 0
        assert printed(gateway, "list")["recordings"] == []
