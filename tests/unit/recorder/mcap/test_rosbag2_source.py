"""What rosbag2 of Jazzy asks of a file and of its folder, as its source has it, which was read for that.

mcap_storage.cpp opens a file, yaml.hpp the metadata.yaml beside it, qos.cpp the profiles in both.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest
import yaml
from mcap.reader import make_reader

from recorder.mcap.recovery import recover
from recorder.mcap.rosbag2 import metadata
from recorder.mcap.writer import SegmentWriter
from recorder.values import VIDEO_TOPIC, GapCause, Loss, Note, SegmentSummary
from recorder.values.offered_qos import OfferedQos, as_yaml
from recorder.video.stream import channel as video_channel
from tests.support.segments import BYTE, STRING, string_sample

if TYPE_CHECKING:
    from collections.abc import Callable

VERSION: Final = 9
"""BagMetadata::version (bag_metadata.hpp). The profiles of a file without metadata.yaml are read by it."""
UINT64: Final = 1 << 64
MOST_NS: Final = 1 << 63
"""Times and durations are std::chrono::nanoseconds."""
TWO_OFFERS = replace(
    STRING, topic="/tf_static", offered_qos=as_yaml([OfferedQos(durability="transient_local"), OfferedQos()])
)
NO_OFFER = replace(STRING, topic="/unexamined", offered_qos=as_yaml([]))
UNDEFINED = replace(STRING, topic="/undefined", type="unknown/msg/Unknown", schema=b"", schema_encoding="")
CHANNELS = [TWO_OFFERS, NO_OFFER, BYTE, UNDEFINED, video_channel(frozenset())]


def finished(writer: SegmentWriter, _part: Path) -> SegmentSummary:
    return writer.finish()


def recovered(writer: SegmentWriter, part: Path) -> SegmentSummary:
    """Completes what a killed recorder has left."""
    writer.flush()
    writer.abandon()
    summary = recover(part)
    assert summary
    return summary


@pytest.fixture(params=[finished, recovered], ids=lambda each: each.__name__)
def segment(tmp_path: Path, request: pytest.FixtureRequest) -> SegmentSummary:
    ends: Callable[[SegmentWriter, Path], SegmentSummary] = request.param
    part = tmp_path / "000000.mcap.part"
    writer = SegmentWriter(part, head=[Note("clock", {"boot": "1"})])
    for number in range(20):
        writer.write(string_sample(number, channel=CHANNELS[number % len(CHANNELS)]))
        if number == 10:
            writer.loss(Loss(BYTE, GapCause.MIDDLEWARE, 1, 2, 3))
            writer.flush()
    return ends(writer, part)


def profiles(node: Any) -> list[dict[str, Any]]:
    """Reads profiles as qos.cpp does from version 9 on; its words are judged by tests of the intake."""
    assert isinstance(node, list)
    for each in node:
        assert all(isinstance(each[name], str) for name in ("reliability", "durability", "liveliness"))
        assert isinstance(each["history"], str), "a number would be that of rmw's enumeration"
        assert each["history"] != "keep_last" or isinstance(each["depth"], int)
        for name in ("deadline", "lifespan", "liveliness_lease_duration"):
            assert all(unsigned(each[name][part]) for part in ("sec", "nsec"))
        assert isinstance(each["avoid_ros_namespace_conventions"], bool)
    return list(node)


def unsigned(value: Any) -> bool:
    return isinstance(value, int) and 0 <= value < UINT64


def test_a_file_alone_has_all_that_its_metadata_are_read_from(segment: SegmentSummary) -> None:
    """read_metadata(): a missing statistics record or schema is an exception, and the file does not open."""
    with segment.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        index = reader.get_summary()
        names = {each.name for each in reader.iter_metadata()}
    assert index
    assert index.statistics
    assert "rosbag2" not in names, "it would be read as what rosbag2's own recorder writes"
    assert index.statistics.message_count == sum(index.statistics.channel_message_counts.values()) == 20
    assert 0 < index.statistics.message_start_time <= index.statistics.message_end_time < MOST_NS
    found = {each.topic: each for each in index.channels.values()}
    assert found.keys() == {each.topic for each in CHANNELS}
    for each in CHANNELS:
        channel = found[each.topic]
        assert index.schemas[channel.schema_id].name == each.type
        assert channel.message_encoding == "cdr", (
            "the only serialization format that ROS 2 has a converter for"
        )
        text = channel.metadata["offered_qos_profiles"]
        # to_rclcpp_qos_vector(): an empty text is no profile, all else has to be a sequence.
        offered = profiles(yaml.safe_load(text)) if text else []
        assert len(offered) == {"/tf_static": 2, VIDEO_TOPIC: 1}.get(each.topic, 0)


def test_a_file_can_be_played_in_the_order_of_its_log_times(segment: SegmentSummary) -> None:
    """message_indexes_present(): without one, set_read_order() refuses, and they come as they are filed."""
    with segment.path.open("rb") as file:
        index = make_reader(file).get_summary()
    assert index
    assert len(index.chunk_indexes) == 2
    assert all(each.message_index_length > 0 for each in index.chunk_indexes)


@pytest.mark.parametrize(
    "about", [{}, {"label": "lap 1: 100 %", "number": "7"}], ids=["nothing", "something"]
)
def test_the_metadata_of_a_folder_have_each_field_in_its_type(
    segment: SegmentSummary, about: dict[str, str]
) -> None:
    """convert<BagMetadata>::decode() and what it calls: a field that is not there is an exception."""
    bag = yaml.safe_load(metadata([segment], about))["rosbag2_bagfile_information"]
    assert (bag["version"], bag["storage_identifier"], bag["ros_distro"]) == (VERSION, "mcap", "jazzy")
    assert (bag["compression_format"], bag["compression_mode"]) == ("", "")
    assert bag["relative_file_paths"] == ["000000.mcap"]
    assert bag["custom_data"] == about
    (file,) = bag["files"]
    assert file["path"] == "000000.mcap"
    for each in (bag, file):
        assert 0 < each["starting_time"]["nanoseconds_since_epoch"] < MOST_NS
        assert 0 <= each["duration"]["nanoseconds"] < MOST_NS
        assert each["message_count"] == 20
    topics = {each["topic_metadata"]["name"]: each for each in bag["topics_with_message_count"]}
    assert topics.keys() == {each.topic for each in CHANNELS}
    for each in CHANNELS:
        topic = topics[each.topic]["topic_metadata"]
        assert topics[each.topic]["message_count"] == 4
        assert (topic["type"], topic["serialization_format"]) == (each.type, "cdr")
        assert topic["type_description_hash"] == "", "a text: null would be read as one"
        profiles(topic["offered_qos_profiles"])


def test_what_was_recorded_of_nothing_has_each_field_too() -> None:
    bag = yaml.safe_load(metadata([]))["rosbag2_bagfile_information"]
    assert bag["starting_time"]["nanoseconds_since_epoch"] == bag["duration"]["nanoseconds"] == 0
    assert bag["topics_with_message_count"] == bag["files"] == []
    assert bag["custom_data"] == {}
