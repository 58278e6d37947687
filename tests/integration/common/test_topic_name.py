"""A topic's name that a configuration may have is one that ROS takes: else serve ended with a traceback."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rclpy.exceptions import InvalidTopicNameException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.validate_full_topic_name import validate_full_topic_name

from common.config import Settings, load
from common.errors import UserError
from common.ros_node import OwnNode
from drive.config import DriveSettings
from gateway.config import GatewaySettings
from preview.config import PreviewSettings
from tests.support.program_settings import file_with

PROGRAMS: Mapping[type[Settings], Any] = {
    GatewaySettings: lambda topic: {"sources": [{"kind": "mode", "topic": topic, "type": "n/msg/O"}]},
    DriveSettings: lambda topic: {"odometry": topic},
    PreviewSettings: lambda topic: {"source": {"kind": "ros", "topic": topic}},
}


def ros_takes(topic: str) -> bool:
    """Whether a topic can have this name. Only the gateway takes relative ones: ~ is its node."""
    try:
        validate_full_topic_name(expand_topic_name(topic, OwnNode.GATEWAY, "/"))
    except InvalidTopicNameException:
        return False
    return True


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.__name__)
@pytest.mark.parametrize("beginning", ["/", "", "~/"], ids=["full", "relative", "private"])
def test_a_name_is_as_long_as_ros_takes_at_the_most(
    tmp_path: Path, program: type[Settings], beginning: str
) -> None:
    topics = [beginning + "a" * (length - len(beginning)) for length in range(200, 260)]

    def accepts(topic: str) -> bool:
        try:
            load(program, file_with(program, PROGRAMS[program](topic), tmp_path / "x.yaml"))
        except UserError:
            return False
        return True

    # Relative names are for the gateway's sources alone.
    taken = [len(each) for each in topics if ros_takes(each)]
    expected = taken if beginning == "/" or program is GatewaySettings else []
    assert [len(each) for each in topics if accepts(each)] == expected
    assert 200 < max(taken) < 259
