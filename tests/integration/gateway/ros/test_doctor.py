"""The doctor looks at a real graph: what fits, what does not, and what to change."""

import pytest
from nav_msgs.msg import Odometry
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import BatteryState

from common.findings import Finding, Verdict
from common.start_command import messages_remedy
from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros import doctor
from gateway.ros.doctor import ros_findings
from tests.support.talker import Talker

pytestmark = pytest.mark.ros
ODOMETRY, VISION, DETECTIONS, BATTERY = DEFAULT_SOURCES[:4]


def examined(*sources: SourceSettings) -> dict[str, Finding]:
    return {finding.check: finding for finding in ros_findings(sources)}


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """For what is published: a busy machine may take longer to discover it."""
    monkeypatch.setattr(doctor, "DISCOVERY_S", 30.0)


@pytest.mark.usefixtures("patient")
def test_what_is_published_as_configured_is_good(talker: Talker) -> None:
    talker.publisher(ODOMETRY.topic, Odometry)
    findings = examined(ODOMETRY)
    assert {finding.verdict for finding in findings.values()} == {Verdict.GOOD}
    assert set(findings) == {"ros.domain", "ros.transport", "type.odometry", "ros", "topic.odometry"}


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("topic", ["~/odometry", "robot_gateway/odometry"])
def test_a_relative_name_is_that_of_the_gateways_node(talker: Talker, topic: str) -> None:
    talker.publisher("/robot_gateway/odometry", Odometry)
    finding = examined(ODOMETRY.model_copy(update={"topic": topic}))["topic.odometry"]
    assert finding.verdict is Verdict.GOOD


@pytest.mark.usefixtures("patient")
def test_another_type_says_which_to_configure(talker: Talker) -> None:
    talker.publisher(ODOMETRY.topic, BatteryState)
    finding = examined(ODOMETRY)["topic.odometry"]
    assert finding.verdict is Verdict.WRONG
    assert finding.remedy == "Set the type of this source to sensor_msgs/msg/BatteryState"


@pytest.mark.usefixtures("patient")
def test_guarantees_that_exclude_each_other(talker: Talker) -> None:
    talker.publisher(BATTERY.topic, BatteryState, reliability=ReliabilityPolicy.BEST_EFFORT)
    strict = BATTERY.model_copy(update={"reliability": "reliable"})
    finding = examined(strict)["topic.battery"]
    assert finding.verdict is Verdict.WRONG
    assert finding.what.endswith(": reliable is requested, best effort is offered")
    assert examined(BATTERY)["topic.battery"].verdict is Verdict.GOOD


@pytest.mark.usefixtures("talker")
def test_a_topic_without_publishers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "DISCOVERY_S", 0.5)
    findings = examined(ODOMETRY, BATTERY)
    assert findings["topic.odometry"].verdict is Verdict.WRONG, "it is required"
    assert findings["topic.battery"].verdict is Verdict.NOTE, "it is not"


@pytest.mark.usefixtures("talker")
def test_a_type_that_is_not_installed_says_what_to_install() -> None:
    missing = SourceSettings(kind="vision", topic="/x", type="no_such_msgs/msg/Thing", stale_after_ms=1000)
    finding = examined(missing)["type.vision"]
    assert finding.verdict is Verdict.WRONG
    assert "topic.vision" not in examined(missing)


@pytest.mark.usefixtures("ros_domain")
def test_a_stand_in_is_named_and_its_topic_is_examined_all_the_same() -> None:
    findings = examined(DETECTIONS)
    finding = findings["type.detections"]
    assert finding.verdict is Verdict.NOTE
    assert finding.what.startswith("yolo_msgs/msg/DetectionArray is this project's stand-in")
    assert finding.remedy == messages_remedy()
    assert "topic.detections" in findings
