"""`robot-drive doctor` beside programs that are none of the robot's."""

import os
from pathlib import Path

import pytest

from common.findings import Verdict
from drive.doctor.examination import examine
from tests.support.helper import first_line, helper

pytestmark = pytest.mark.ros


@pytest.mark.usefixtures("ros_domain")
def test_a_peer_whose_name_is_no_text_is_a_finding(tmp_path: Path) -> None:
    config = tmp_path / "drive.yaml"
    config.write_text("odometry: /odom\n", encoding="utf-8")
    assert os.environ["ROS_DOMAIN_ID"]
    with helper("tests.support.undecodable_peer", "/odom") as peer:
        assert first_line(peer) == "ready\n"
        found = list(examine(config, with_pulse=False))
    assert found[-1].verdict is Verdict.WRONG
    assert "a name that is no text" in found[-1].what
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE" in found[-1].remedy
