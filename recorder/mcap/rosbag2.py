"""The metadata.yaml of rosbag2: with it beside them, `ros2 bag play` and others open a folder of segments."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import yaml

from recorder.mcap.records import CDR
from recorder.values import SegmentSummary

FILE_NAME: Final = "metadata.yaml"
_VERSION: Final = 9
"""Of the format, as Jazzy's rosbag2 (0.26) writes it."""
_DISTRIBUTION: Final = "jazzy"


def metadata(segments: Sequence[SegmentSummary], about: Mapping[str, str] = MappingProxyType({})) -> str:
    """Returns the content of the metadata.yaml that lies in the folder of these segments.

    Args:
        segments: those without messages are left out: some readers don't open them.
        about: what else is known of the recording: rosbag2's "custom_data".
    """
    filled = [each for each in segments if each.first_ns is not None and each.last_ns is not None]
    information = {
        "version": _VERSION,
        "storage_identifier": "mcap",
        **_span(filled),
        "topics_with_message_count": _topics(filled),
        # Of rosbag2's own compression around files or messages; that of MCAP's chunks is no concern of it.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [each.path.name for each in filled],
        "files": [{"path": each.path.name, **_span([each])} for each in filled],
        "custom_data": dict(about),
        "ros_distro": _DISTRIBUTION,
    }
    return yaml.safe_dump(
        {"rosbag2_bagfile_information": information}, sort_keys=False, allow_unicode=True, width=1000
    )


def _span(segments: Sequence[SegmentSummary]) -> dict[str, Any]:
    first_ns = min((each.first_ns for each in segments if each.first_ns is not None), default=0)
    last_ns = max((each.last_ns for each in segments if each.last_ns is not None), default=0)
    return {
        "duration": {"nanoseconds": last_ns - first_ns},
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "message_count": sum(each.messages for each in segments),
    }


def _topics(segments: Sequence[SegmentSummary]) -> list[dict[str, Any]]:
    """Returns each topic and type once, with the QoS that was offered last."""
    counts: dict[tuple[str, str], int] = {}
    offered: dict[tuple[str, str], str] = {}
    for channel in (each for segment in segments for each in segment.channels):
        key = channel.topic, channel.type
        counts[key] = counts.get(key, 0) + channel.messages
        offered[key] = channel.offered_qos
    return [
        {
            "topic_metadata": {
                "name": name,
                "type": type_name,
                "serialization_format": CDR,
                # Read once: a recording of a day has 1440 segments, and to read YAML takes milliseconds.
                "offered_qos_profiles": _profiles(offered[name, type_name]),
                "type_description_hash": "",
            },
            "message_count": count,
        }
        for (name, type_name), count in counts.items()
    ]


def _profiles(text: str) -> Any:
    """Returns the profiles of a channel's metadata; none where it is no YAML, as another program's may be."""
    try:
        return yaml.safe_load(text) or []
    except yaml.YAMLError:
        return []
