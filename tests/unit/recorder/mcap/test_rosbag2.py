"""Folders of segments with metadata.yaml, as rosbags, which shares no code with rosbag2, reads them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from recorder.mcap.rosbag2 import FILE_NAME, metadata
from recorder.mcap.writer import SegmentWriter
from recorder.values import Channel, ChannelSummary, SegmentSummary
from tests.support.segments import BYTE, STRING, string_sample

QOS = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
LATCHED = Channel("/tf_static", "std_msgs/msg/String", b"string data\n", "ros2msg", QOS, True, frozenset())


def written(folder: Path, name: str, numbers: range, *channels: Channel) -> SegmentSummary:
    writer = SegmentWriter(folder / f"{name}.mcap.part")
    for number in numbers:
        writer.write(string_sample(number, channel=channels[number % len(channels)]))
    return writer.finish()


def test_a_folder_opens_as_one_bag(tmp_path: Path) -> None:
    segments = [
        written(tmp_path, "000000", range(6), STRING, LATCHED),
        written(tmp_path, "000001", range(6, 6)),
        written(tmp_path, "000002", range(6, 15), BYTE, LATCHED, STRING),
    ]
    (tmp_path / FILE_NAME).write_text(metadata(segments))
    with Reader(tmp_path) as bag:
        assert bag.message_count == 15
        assert bag.start_time == 1_000_000_000
        assert bag.end_time == 1_000_000_000 + 14 + 1
        assert {each.topic: each.msgcount for each in bag.connections} == {
            "/chatter": 6,
            "/tf_static": 6,
            "/byte": 3,
        }
        assert [at_ns - 1_000_000_000 for _, at_ns, _ in bag.messages()] == list(range(15))
        offered = next(each.ext for each in bag.connections if each.topic == "/tf_static")
        assert isinstance(offered, ConnectionExtRosbag2)
        (qos,) = offered.offered_qos_profiles
        assert (qos.durability, qos.reliability) == (QosDurability.TRANSIENT_LOCAL, QosReliability.RELIABLE)


def test_a_topic_that_changes_its_type_has_two_entries(tmp_path: Path) -> None:
    other = replace(STRING, type="std_msgs/msg/Byte")
    segment = written(tmp_path, "0", range(4), STRING, other)
    information = yaml.safe_load(metadata([segment]))["rosbag2_bagfile_information"]
    topics = [each["topic_metadata"] for each in information["topics_with_message_count"]]
    assert [(each["name"], each["type"]) for each in topics] == [
        ("/chatter", "std_msgs/msg/String"),
        ("/chatter", "std_msgs/msg/Byte"),
    ]


def test_nothing_recorded_is_an_empty_bag() -> None:
    information = yaml.safe_load(metadata([]))["rosbag2_bagfile_information"]
    assert information["message_count"] == 0
    assert information["relative_file_paths"] == []


def test_the_qos_of_a_topic_is_read_once_however_many_files_there_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Reading YAML takes milliseconds, and nothing else is done while a recording ends."""
    read: list[str] = []
    load = yaml.safe_load

    def counted(text: str) -> Any:
        read.append(text)
        return load(text)

    monkeypatch.setattr(yaml, "safe_load", counted)
    channels = (ChannelSummary("/tf_static", "std_msgs/msg/String", QOS, 1),)
    segments = [
        SegmentSummary(Path(f"{number:06}.mcap"), 1, "0" * 64, 1, channels, number + 1, number + 1, ())
        for number in range(100)
    ]
    text = metadata(segments)
    assert read == [QOS]
    (topic,) = load(text)["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert topic["message_count"] == 100
    assert topic["topic_metadata"]["offered_qos_profiles"][0]["durability"] == "transient_local"


def test_metadata_of_another_program_that_is_no_yaml_costs_no_recording() -> None:
    channels = (ChannelSummary("/a", "std_msgs/msg/String", "a: b: c", 1),)
    segment = SegmentSummary(Path("000000.mcap"), 1, "0" * 64, 1, channels, 1, 1, ())
    (topic,) = yaml.safe_load(metadata([segment]))["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert topic["topic_metadata"]["offered_qos_profiles"] == []
