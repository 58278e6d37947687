"""What rosbag2 reads of the QoS of a channel: rmw's words, of every policy that rclpy knows."""

from enum import Enum
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from rclpy.duration import Infinite
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2.metadata import parse_qos

from recorder.intake.qos import offered_qos
from recorder.video.stream import channel

WORDS = {
    "history": {"system_default", "keep_last", "keep_all", "unknown"},
    "reliability": {"system_default", "reliable", "best_effort", "best_available", "unknown"},
    "durability": {"system_default", "transient_local", "volatile", "best_available", "unknown"},
    "liveliness": {"system_default", "automatic", "manual_by_topic", "best_available", "unknown"},
}
"""Of rmw's qos_string_conversions.c, and "unknown" of rosbag2's qos.cpp."""
POLICIES: list[tuple[str, Enum]] = [
    *(("history", each) for each in HistoryPolicy),
    *(("reliability", each) for each in ReliabilityPolicy),
    *(("durability", each) for each in DurabilityPolicy),
    *(("liveliness", each) for each in LivelinessPolicy),
]


def text_of(**policies: Any) -> str:
    """Returns what is written of a publisher as the graph shows it: what has no limit is infinite there."""
    infinite = dict.fromkeys(("deadline", "lifespan", "liveliness_lease_duration"), Infinite)
    given = {"depth": 1, "history": HistoryPolicy.KEEP_LAST} | infinite | policies
    return offered_qos([SimpleNamespace(qos_profile=QoSProfile(**given))])


def read(text: str) -> dict[str, Any]:
    """Returns the only profile, whose words are all rmw's."""
    (profile,) = yaml.safe_load(text)
    assert {name for name, words in WORDS.items() if profile[name] not in words} == set()
    for name in ("deadline", "lifespan", "liveliness_lease_duration"):
        assert profile[name] == {"sec": 9223372036, "nsec": 854775807}, "rmw's infinite"
    assert isinstance(profile["depth"], int)
    assert profile["avoid_ros_namespace_conventions"] is False
    return dict(profile)


@pytest.mark.parametrize(("policy", "value"), POLICIES, ids=lambda each: getattr(each, "name", each))
def test_every_policy_of_a_topic_is_a_word_of_rmw(policy: str, value: Enum) -> None:
    assert read(text_of(**{policy: value}))[policy] == value.name.lower()


def test_the_video_is_offered_in_words_as_every_topic_is() -> None:
    """The defect: numbers, which rosbag2 takes for version 8, in a file of version 9."""
    text = channel(frozenset()).offered_qos
    assert read(text).keys() == read(text_of()).keys()
    (qos,) = parse_qos(text)
    assert (qos.reliability, qos.durability) == (QosReliability.RELIABLE, QosDurability.VOLATILE)
