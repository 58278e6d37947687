"""The robot at a glance: what it says, and when it is sent."""

from bridge.config import GatewaySettings
from bridge.connection.robot_state import Own, due_in_s, is_charging, robot_state, same_but_for_time
from bridge.robot.status import StatusReader
from omniseer.fleet.v1.upload_pb2 import UploadBrief
from omniseer.gateway.v1 import fault_pb2
from omniseer.gateway.v1.system_status_pb2 import SystemStatus


def own(**changes: object) -> Own:
    values = {
        "robot": "lab2",
        "bridge_version": "1.2.3",
        "gateway_target": "",
        "gateway_reachable": True,
        "outbox_events": 0,
        "events_dropped": 0,
    }
    return Own(**{**values, **changes})  # type: ignore[arg-type]


def status() -> SystemStatus:
    made = SystemStatus(gateway_name="gw", gateway_version="1")
    made.gateway.uptime_ms = 125_000
    made.platform.power.lipo_battery.available = True
    made.platform.power.lipo_battery.percentage_available = True
    made.platform.power.lipo_battery.percentage = 71.6
    return made


def fault(number: int, severity: int, *, active: bool = True, age_ms: int = 0) -> fault_pb2.Fault:
    return fault_pb2.Fault(id=f"f{number}", severity=severity, active=active, age_ms=age_ms)  # type: ignore[arg-type]


def test_numbers_are_rounded_so_that_they_change_rarely() -> None:
    state = robot_state(own(), status())
    assert (state.battery_percent, state.gateway_uptime_s) == (72, 120)
    assert not state.HasField("charging")
    assert not state.HasField("disk_used_percent")


def test_time_alone_is_no_change() -> None:
    now, later = status(), status()
    later.gateway.uptime_ms += 60_000
    later.platform.power.lipo_battery.percentage = 71.8
    before, after = robot_state(own(), now), robot_state(own(), later)
    assert before != after
    assert same_but_for_time(before) == same_but_for_time(after)
    later.health.ready = True
    assert same_but_for_time(before) != same_but_for_time(robot_state(own(), later))


def test_the_worst_and_then_the_oldest_faults_are_named() -> None:
    made = status()
    made.faults.extend([fault(1, 2, age_ms=5), fault(2, 3, age_ms=1), fault(3, 3, age_ms=9)])
    made.faults.append(fault(4, 3, active=False))
    made.faults.extend(fault(number, 1) for number in range(10, 20))
    state = robot_state(own(), made)
    assert [each.fault_id for each in state.faults[:3]] == ["f3", "f2", "f1"]
    assert (len(state.faults), state.fault_count) == (8, 13)


def test_values_that_are_no_percentages_stay_in_bounds() -> None:
    for value, shown in ((float("nan"), 0), (-3.0, 0), (1e9, 100)):
        made = status()
        made.platform.power.lipo_battery.percentage = value
        assert robot_state(own(), made).battery_percent == shown


def test_what_is_stale_is_not_known() -> None:
    made = status()
    battery, compute = made.platform.power.lipo_battery, made.platform.compute
    battery.charging_available = battery.charging = True
    compute.available = compute.disk_available = True
    compute.disk_used_percent = 40.0
    state = robot_state(own(), made)
    assert (state.battery_percent, state.charging, state.disk_used_percent) == (72, True, 40)
    battery.stale = compute.stale = True
    state = robot_state(own(), made)
    for name in ("battery_percent", "charging", "disk_used_percent"):
        assert not state.HasField(name)


def test_whether_it_charges_is_known_while_the_gateway_says_so() -> None:
    made = status()
    made.platform.power.lipo_battery.charging_available = True
    made.platform.power.lipo_battery.charging = True
    reader = StatusReader(GatewaySettings())
    reader.newest, reader.reachable = made, True
    assert is_charging(reader.current) is True
    reader.reachable = False
    assert is_charging(reader.current) is None
    assert reader.newest is made, "what was last known is shown as such"


def test_the_first_uploads_are_named() -> None:
    uploads = tuple(UploadBrief(recording_id=str(number)) for number in range(6))
    state = robot_state(own(uploads=uploads), None)
    assert (len(state.uploads), state.upload_count) == (4, 6)


def test_a_change_is_sent_at_most_once_a_second_and_otherwise_every_ten() -> None:
    assert due_in_s(changed=True, since_sent_s=0.4) > 0
    assert due_in_s(changed=True, since_sent_s=1.0) <= 0
    assert due_in_s(changed=False, since_sent_s=9.9) > 0
    assert due_in_s(changed=False, since_sent_s=10.0) <= 0
