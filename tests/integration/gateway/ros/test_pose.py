"""Position and orientation, from real messages to the contract."""

import json
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from tests.support.gateway_program import gateway_program
from tests.support.robotctl import robotctl_process
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(90)]

SOURCES = [
    {"kind": "position", "topic": "/fix", "type": "sensor_msgs/msg/NavSatFix", "stale_after_ms": 60_000},
    {"kind": "orientation", "topic": "/imu", "type": "sensor_msgs/msg/Imu", "stale_after_ms": 60_000},
]


def fix(status: int) -> NavSatFix:
    message = NavSatFix(latitude=48.1234567, longitude=-11.5, altitude=520.0)
    message.status.status = status
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    message.position_covariance[0], message.position_covariance[4] = 9.0, 16.0
    return message


def imu(first: float) -> Imu:
    """Rolled by 60 degrees, if the first element of the covariance does not say that nothing is known."""
    message = Imu(orientation=Quaternion(x=0.5, y=0.0, z=0.0, w=0.8660254037844386))
    message.orientation_covariance[0] = first
    return message


def test_a_position_and_an_orientation(talker: Talker, tmp_path: Path) -> None:
    with gateway_program(tmp_path, sources=SOURCES, faults={"clear_after_ms": 100}) as gateway:
        receiver, sensor = talker.publisher("/fix", NavSatFix), talker.publisher("/imu", Imu)

        def until(position: NavSatFix, orientation: Imu, *faults: str) -> Any:
            """Publishes both until exactly these faults are active besides the preview's."""

            def there() -> bool:
                receiver.publish(position)
                sensor.publish(orientation)
                status = gateway.status()
                active = {each.id for each in status.faults if each.active and "preview" not in each.id}
                return bool(
                    status.position.available and status.orientation.available and active == set(faults)
                )

            wait_until(there, f"the faults {faults}")
            return gateway.status()

        lost = until(fix(NavSatStatus.STATUS_NO_FIX), imu(-1.0), "position.no_fix")
        assert not lost.position.HasField("latitude_deg")
        assert not lost.orientation.HasField("roll_deg")

        until(fix(NavSatStatus.STATUS_GBAS_FIX), imu(0.01), "orientation.tilt")
        document = json.loads(
            robotctl_process("--target", f"127.0.0.1:{gateway.port}", "status", "--json").stdout
        )
        position, orientation = document["position"], document["orientation"]
        assert (position["fix"], position["latitude_deg"], position["longitude_deg"]) == (
            "gbas",
            48.1234567,
            -11.5,
        )
        assert (position["horizontal_accuracy_m"], position["vertical_accuracy_m"]) == (5.0, 0.0)
        assert (orientation["roll_deg"], orientation["pitch_deg"], orientation["yaw_deg"]) == (60.0, 0.0, 0.0)
