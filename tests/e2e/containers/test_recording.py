"""Recording through the containers: started and copied from outside, judged by independent readers."""

import json
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from console.client.results import RecorderState
from tests.e2e.containers.deployment import Deployment
from tests.support import judges
from tests.support.robotctl import robotctl_process
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.gst, pytest.mark.timeout(900)]

VIDEO = "/preview/video"
ODOMETRY = "/odometry/filtered"
MESSAGES = 500
BACK_WITHIN_S = 60.0


@pytest.fixture
def recording(demo: Deployment) -> Iterator[Deployment]:
    """The robot, and its recorder is idle; so it is afterwards."""
    wait_until(lambda: status(demo).state is RecorderState.IDLE, "the recorder is idle", BACK_WITHIN_S)
    yield demo
    end(demo)


def end(robot: Deployment) -> None:
    """Ends a recording that goes on."""
    if status(robot).recording_id:
        record(robot, "stop")


def status(robot: Deployment) -> Any:
    """Recording, as the operators' status has it."""
    with robot.client() as gateway:
        return gateway.status().recording


def record(robot: Deployment, *words: str) -> Any:
    """What `robotctl record` prints."""
    ran = robotctl_process("--target", robot.target, "record", *words, "--json")
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


def written(robot: Deployment) -> int:
    return int(status(robot).messages_written)


def decoded(folder: Path) -> tuple[Counter[str], bytes, list[float]]:
    """Messages by topic, the video's access units, and the times of the odometry, by mcap-ros2-support."""
    counts: Counter[str] = Counter()
    units: list[bytes] = []
    times_s: list[float] = []
    for file in sorted(folder.glob("data/*.mcap")):
        with file.open("rb") as content:
            reader = make_reader(content, decoder_factories=[DecoderFactory()], validate_crcs=True)
            for _, channel, _, message in reader.iter_decoded_messages():
                counts[channel.topic] += 1
                if channel.topic == VIDEO:
                    units.append(bytes(message.data))
                elif channel.topic == ODOMETRY:
                    times_s.append(message.header.stamp.sec + message.header.stamp.nanosec / 1e9)
    return counts, b"".join(units), times_s


def test_topics_and_video_arrive_on_another_computer_as_they_were(
    recording: Deployment, tmp_path: Path
) -> None:
    def attempt() -> Any:
        end(recording)
        # A recorder that stands still with the machine loses messages, and says so.
        with no_stall():
            record(recording, "start", "--preset", "everything", "--video", "--label", "e2e")
            wait_until(lambda: status(recording).video, "the video is recorded, and no one watches")
            wait_until(lambda: written(recording) >= MESSAGES, f"{MESSAGES} messages")
            done = record(recording, "stop")["recording"]
            assert (done["state"], done["messages_lost"]) == ("complete", 0)
        return done

    done = undisturbed(attempt)
    recording_id = done["id"]
    copied = record(recording, "export", recording_id, "--to", str(tmp_path))
    assert copied["not_final"] == []
    folder = tmp_path / recording_id
    counts, units, times_s = decoded(folder)
    assert counts.total() == done["messages_written"] >= MESSAGES
    assert counts[VIDEO] == done["video_frames"] > 0
    assert times_s == sorted(set(times_s))
    with Reader(folder / "data") as bag:
        assert {topic: each.msgcount for topic, each in bag.topics.items()} == counts
    stream = tmp_path / "video.h264"
    stream.write_bytes(units)
    assert judges.complaints(stream) == ""
    assert judges.decoded_frames(stream) == counts[VIDEO]


def test_a_killed_recorder_is_started_again_and_goes_on_with_what_it_recorded(
    recording: Deployment, tmp_path: Path
) -> None:
    recording_id = record(recording, "start", "--no-video")["recording"]["id"]
    wait_until(lambda: written(recording) >= MESSAGES, f"{MESSAGES} messages")
    restarts, before = recording.restarts("recorder"), written(recording)
    recording.signal_all("recorder", signal.SIGKILL)
    wait_until(lambda: recording.restarts("recorder") > restarts, "the engine starts it again", BACK_WITHIN_S)
    wait_until(
        lambda: status(recording).recording_id == recording_id and written(recording) > before,
        "the recording goes on",
        BACK_WITHIN_S,
    )
    record(recording, "stop")
    done = record(recording, "show", recording_id)
    assert done["state"] == "complete"
    assert "interrupted" in {gap["cause"] for gap in done["gaps"]}
    record(recording, "export", recording_id, "--to", str(tmp_path))
    counts, _, times_s = decoded(tmp_path / recording_id)
    assert counts.total() == done["messages_written"] > before
    assert times_s == sorted(set(times_s)), "in order, and each once"
    with Reader(tmp_path / recording_id / "data") as bag:
        assert bag.message_count == counts.total()
