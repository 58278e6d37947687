"""What counts as a fault, rule by rule."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from common.start_command import messages_remedy
from gateway.config.faults import FaultSettings, LowerLimit, UpperLimit
from gateway.status.board import Board, Publishers, Unusable
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.faults.rules import FaultRules, conditions
from gateway.status.faults.sources import STATE_FAULTS
from gateway.status.limit import Limit
from gateway.status.preview import Camera, CameraState, Encoder, PreviewState, PreviewView
from gateway.status.snapshot import Snapshot, SourceRule
from gateway.status.source_view import SourceState, detail
from gateway.status.sources import (
    BATTERY,
    COMPUTE,
    DETECTIONS,
    DIAGNOSTICS,
    MODE,
    NETWORK,
    ODOMETRY,
    ONBOARD_BATTERY,
    ORIENTATION,
    POSITION,
    SOURCES,
    SourceSpec,
)
from gateway.status.values import (
    Battery,
    Compute,
    DiagnosticItem,
    DiagnosticLevel,
    Diagnostics,
    Fix,
    Mode,
    Network,
    Orientation,
    Position,
    Received,
    Velocity,
)
from tests.support.fault_rules import LIMITS
from tests.support.status import OFF, snapshot_of

NOW_S = 500.0
RULES = FaultRules(LIMITS, startup_grace_s=5.0)
COOL = Compute(10.0, 50.0, False, 1, 4, 50.0)
STRONG = Network("wlan0", True, -50, 90)
BY_NAME = {spec.name: spec for spec in SOURCES}
FULL = Battery(True, 15.0, 90.0, False)


def board(
    compute: Compute = COOL,
    network: Network = STRONG,
    battery: Battery = FULL,
    onboard: Battery = FULL,
    at_s: float = NOW_S,
) -> Board:
    return Board(
        {
            COMPUTE: Received(compute, at_s),
            NETWORK: Received(network, at_s),
            BATTERY: Received(battery, at_s),
            ONBOARD_BATTERY: Received(onboard, at_s),
        }
    )


def snapshot(of: Board, preview: PreviewView = OFF, **required: bool) -> Snapshot:
    rules = {BY_NAME[name]: SourceRule(1000, must) for name, must in required.items()}
    return snapshot_of(of, rules, now_s=NOW_S, preview=preview)


def found(of: Snapshot, active: frozenset[str] = frozenset(), up_s: float = 100.0) -> dict[str, Condition]:
    faults = tuple(fault_of(fault_id) for fault_id in active)
    return {each.fault_id: each for each in conditions(replace(of, faults=faults), RULES, active, up_s)}


def fault_of(fault_id: str) -> Fault:
    """A fault whose condition was present at the last look."""
    condition = Condition(fault_id, Severity.WARNING, "component", "message", "remedy")
    return Fault(condition, NOW_S - 1, NOW_S - 1, None, 1, condition.severity)


def test_nothing_is_wrong_with_a_robot_that_is_well() -> None:
    well = board()
    well[ODOMETRY] = Received(Velocity(0, 0, 0), NOW_S)
    assert found(snapshot(well, odometry=True, battery=False)) == {}


def test_every_state_of_a_source_has_its_verdict() -> None:
    assert set(STATE_FAULTS) == set(SourceState)
    for state in SourceState:
        assert bool(detail(state, "odometry", None)) == (STATE_FAULTS[state] is not None)


@pytest.mark.parametrize(
    ("at_s", "required", "up_s", "expected"),
    [
        (None, True, 4.9, {}),
        (None, True, 5.0, {"odometry.missing": Severity.ERROR}),
        (None, False, 5.0, {}),
        (NOW_S - 2, True, 0.0, {"odometry.stale": Severity.ERROR}),
        (NOW_S - 2, False, 0.0, {"odometry.stale": Severity.WARNING}),
        (NOW_S - 1, True, 0.0, {}),
    ],
)
def test_a_source_that_does_not_come(
    at_s: float | None, required: bool, up_s: float, expected: dict[str, Severity]
) -> None:
    of = board()
    if at_s is not None:
        of[ODOMETRY] = Received(Velocity(0, 0, 0), at_s)
    faults = found(snapshot(of, odometry=required), up_s=up_s)
    assert {fault_id: fault.severity for fault_id, fault in faults.items()} == expected


@pytest.mark.parametrize(
    ("publishers", "at_s", "expected"),
    [
        (Publishers(1), None, "odometry.silent"),
        (Publishers(2, qos_mismatch="x"), None, "odometry.qos_mismatch"),
        (Publishers(1, wrong_type=True), None, "odometry.wrong_type"),
        (Publishers(0), None, "odometry.missing"),
        (Publishers(1), NOW_S - 2, "odometry.stale"),
        (Publishers(1, qos_mismatch="x"), NOW_S - 2, "odometry.qos_mismatch"),
        (Publishers(0), NOW_S - 2, "odometry.stale"),
        (Publishers(1, wrong_type=True), NOW_S, None),
    ],
)
def test_why_a_source_does_not_come(publishers: Publishers, at_s: float | None, expected: str | None) -> None:
    of = board()
    if at_s is not None:
        of[ODOMETRY] = Received(Velocity(0, 0, 0), at_s)
    of.publishers[ODOMETRY] = publishers
    assert set(found(snapshot(of, odometry=True))) == ({expected} if expected else set())


@pytest.mark.parametrize(("up_s", "expected"), [(4.9, set()), (5.0, {"odometry.silent"})])
def test_a_publisher_may_be_silent_until_the_startup_grace_has_elapsed(
    up_s: float, expected: set[str]
) -> None:
    of = board()
    of.publishers[ODOMETRY] = Publishers(1)
    assert set(found(snapshot(of, odometry=True), up_s=up_s)) == expected


def test_messages_that_cant_be_decoded() -> None:
    of = board()
    of.publishers[ODOMETRY] = Publishers(1)
    of.undecodable.add(ODOMETRY)
    assert set(found(snapshot(of, odometry=True))) == {"odometry.undecodable"}
    _, remedy = STATE_FAULTS[SourceState.UNDECODABLE] or ("", "")
    assert remedy.endswith(messages_remedy())
    of[ODOMETRY] = Received(Velocity(0, 0, 0), NOW_S)
    assert found(snapshot(of, odometry=True)) == {}, "a fresh value was decoded"


def test_a_sampler_without_progress_is_one_fault_and_accuses_no_publisher() -> None:
    of = board()
    of.publishers[ODOMETRY] = Publishers(1)
    of[ODOMETRY] = Received(Velocity(0, 0, 0), NOW_S - 3)
    of.ros_passed_s = NOW_S - 2.1
    stalled = snapshot(of, odometry=True)
    assert set(found(stalled)) == {"ros.stalled"}
    assert found(stalled)["ros.stalled"].severity is Severity.ERROR
    assert stalled.health.summary == "the gateway does not read ROS"
    assert not stalled.health.ready
    assert stalled.sources[0].detail == "the gateway does not read ROS at the moment"
    of[ODOMETRY] = Received(Velocity(0, 0, 0), NOW_S - 3.2)
    active = frozenset({"odometry.stale"})
    assert set(found(snapshot(of, odometry=True), active)) == {"ros.stalled", "odometry.stale"}
    of.ros_passed_s = NOW_S - 1.9
    assert set(found(snapshot(of, odometry=True))) == {"odometry.stale"}


@pytest.mark.parametrize(
    ("received_s", "passed_s", "faults", "detail", "health"),
    [
        pytest.param(
            1.5,
            0.9,
            set(),
            "the gateway does not read ROS at the moment",
            "the gateway does not read ROS",
            id="the sampler hangs",
        ),
        pytest.param(
            1.01, 0.03, set(), "odometry stopped coming", "odometry stale", id="the next pass will show it"
        ),
        pytest.param(
            1.9,
            0.89,
            {"odometry.stale"},
            "odometry stopped coming",
            "odometry stale",
            id="silent before that",
        ),
        pytest.param(0.9, 0.85, set(), "", "robot healthy", id="not old yet"),
    ],
)
def test_silence_accuses_a_publisher_at_the_last_pass_of_the_sampler(
    received_s: float, passed_s: float, faults: set[str], detail: str, health: str
) -> None:
    """The defect: a sampler that hung for a second accused every publisher."""
    of = board()
    of.publishers[ODOMETRY] = Publishers(1)
    of[ODOMETRY], of.ros_passed_s = Received(Velocity(0, 0, 0), NOW_S - received_s), NOW_S - passed_s
    seen = snapshot(of, odometry=True)
    assert set(found(seen)) == faults
    assert (seen.sources[0].detail, seen.health.summary) == (detail, health)
    assert seen[ODOMETRY].freshness.stale == (received_s > 1), "whatever the reason: operators see its age"


def test_two_publishers_of_one_source_are_said_so() -> None:
    of = board()
    of[ODOMETRY], of.publishers[ODOMETRY] = Received(Velocity(0, 0, 0), NOW_S), Publishers(2)
    (source,) = snapshot(of, odometry=True).sources
    assert (source.state, source.detail[:24]) == (SourceState.RECEIVING, "2 programs publish odome")


def test_a_mode_that_does_not_change_is_no_fault() -> None:
    of = board()
    of[MODE] = Received(Mode("idle"), NOW_S - 100)
    assert found(snapshot(of, mode=False)) == {}
    assert set(found(snapshot(of, mode=True))) == {"mode.stale"}


def reported(*items: DiagnosticItem) -> dict[str, Condition]:
    of = board()
    of[DIAGNOSTICS] = Received(Diagnostics(items), NOW_S)
    return found(snapshot(of, diagnostics=False))


def test_components_in_trouble_are_faults_and_others_are_not() -> None:
    faults = reported(
        DiagnosticItem("/drive/left_motor: Current", DiagnosticLevel.ERROR, "over\x00current"),
        DiagnosticItem("lidar", DiagnosticLevel.STALE, ""),
        DiagnosticItem("imu", DiagnosticLevel.WARNING, "drifts"),
        DiagnosticItem("gps", DiagnosticLevel.OK, ""),
    )
    assert {fault_id: fault.severity for fault_id, fault in faults.items()} == {
        "diagnostics.drive_left_motor_current": Severity.ERROR,
        "diagnostics.lidar": Severity.WARNING,
    }
    motor = faults["diagnostics.drive_left_motor_current"]
    assert motor.message == "drive left_motor: Current: over current"
    assert faults["diagnostics.lidar"].message == "lidar: has stopped reporting"


def test_names_that_are_no_names_and_texts_without_end() -> None:
    faults = reported(
        DiagnosticItem("\udcff\udcfe", DiagnosticLevel.ERROR, "x" * 10_000),
        DiagnosticItem("", DiagnosticLevel.STALE, ""),
    )
    (fault,) = faults.values()
    assert (fault.fault_id, fault.severity) == ("diagnostics.unnamed", Severity.ERROR)
    assert len(fault.message) < 300
    fault.message.encode("utf-8")


def test_a_missing_type_is_reported_at_once_without_its_name() -> None:
    of = board()
    of.unusable[DETECTIONS] = Unusable("message type yolo_msgs/msg/DetectionArray is not installed")
    faults = found(snapshot(of, detections=False), up_s=0.0)
    assert set(faults) == {"detections.type_missing"}
    assert "yolo" not in str(faults)


@pytest.mark.parametrize(
    ("of", "expected"),
    [
        (board(compute=replace(COOL, cpu_temperature_c=85.0)), "platform.temperature"),
        (board(compute=replace(COOL, thermal_throttled=True)), "platform.throttled"),
        (board(compute=replace(COOL, ram_used_bytes=93, ram_total_bytes=100)), "platform.memory"),
        (board(compute=replace(COOL, disk_used_percent=95.0)), "platform.disk"),
        (board(network=replace(STRONG, wifi_signal_dbm=-75)), "platform.wifi"),
        (board(battery=replace(FULL, charge_percent=20.0)), "battery.low"),
        (board(onboard=replace(FULL, charge_percent=20.0)), "platform.battery_low"),
    ],
)
def test_a_figure_beyond_its_limit(of: Board, expected: str) -> None:
    faults = found(snapshot(of, battery=False))
    assert set(faults) == {expected}
    assert faults[expected].remedy


def test_between_the_two_limits_what_was_said_stands() -> None:
    warm = snapshot(board(compute=replace(COOL, cpu_temperature_c=82.0)))
    assert found(warm) == {}
    assert set(found(warm, frozenset({"platform.temperature"}))) == {"platform.temperature"}
    cool = snapshot(board(compute=replace(COOL, cpu_temperature_c=80.0)))
    assert found(cool, frozenset({"platform.temperature"})) == {}


@pytest.mark.parametrize(
    "battery", [replace(FULL, charge_percent=5.0, charging=True), Battery(False, None, 5.0, None)]
)
def test_a_battery_that_charges_or_is_not_there_is_not_low(battery: Battery) -> None:
    assert found(snapshot(board(battery=battery), battery=False), frozenset({"battery.low"})) == {}


def test_a_charge_outside_its_range_is_a_fault_that_says_so() -> None:
    """Many publishers send 0 to 100."""
    wrong = board(battery=replace(FULL, charge_percent=None, charge_out_of_range=True))
    faults = found(snapshot(wrong, battery=False))
    assert set(faults) == {"battery.out_of_range"}
    assert "0 to 1" in faults["battery.out_of_range"].remedy


def test_what_is_not_known_neither_raises_nor_ends_a_fault() -> None:
    unknown = board(Compute(10.0, None, None, 1, 4, None), Network("eth0", True, None, None))
    active = frozenset({"platform.temperature", "platform.throttled", "platform.wifi", "platform.disk"})
    assert found(snapshot(unknown)) == {}
    assert set(found(snapshot(unknown), active)) == active


def test_a_stale_charge_neither_raises_nor_clears_a_fault() -> None:
    for charge_percent, active in ((5.0, frozenset[str]()), (90.0, frozenset({"battery.low"}))):
        of = board()
        of[BATTERY] = Received(replace(FULL, charge_percent=charge_percent), NOW_S - 10)
        # Its staleness is a fault of the source.
        assert found(snapshot(of, battery=False), active).keys() - {"battery.stale"} == active


def test_a_computer_that_is_not_looked_at_any_more_is_a_fault_of_its_own() -> None:
    old = board(compute=replace(COOL, cpu_temperature_c=99.0), at_s=NOW_S - 10)
    assert set(found(snapshot(old))) == {"platform.stale"}


@pytest.mark.parametrize("spec", [COMPUTE, NETWORK], ids=lambda spec: spec.name)
def test_one_stale_part_of_the_computer_is_enough(spec: SourceSpec[Any]) -> None:
    parts: dict[SourceSpec[Any], Any] = {COMPUTE: COOL, NETWORK: STRONG}
    of = Board({each: Received(part, NOW_S - 10 * (each is spec)) for each, part in parts.items()})
    assert set(found(snapshot(of))) == {"platform.stale"}


def test_a_preview_that_tries_again_has_not_recovered() -> None:
    starting = snapshot(board(), replace(OFF, state=PreviewState.STARTING, last_error="no camera"))
    assert found(starting) == {}
    assert set(found(starting, frozenset({"preview.faulted"}))) == {"preview.faulted"}


def test_an_unreachable_preview_service_is_one_fault_not_two() -> None:
    wanted = replace(OFF, state=PreviewState.FAULTED, last_error="unreachable", service_reachable=False)
    faults = found(snapshot(board(), wanted), up_s=0.0)
    assert {fault_id: fault.severity for fault_id, fault in faults.items()} == {
        "preview.unreachable": Severity.ERROR
    }
    unwanted = replace(OFF, service_reachable=False)
    assert found(snapshot(board(), unwanted), up_s=4.9) == {}
    assert found(snapshot(board(), unwanted))["preview.unreachable"].severity is Severity.WARNING


def test_another_encoder_than_the_wanted_one_is_a_fault_that_names_both() -> None:
    running = replace(
        OFF, state=PreviewState.RUNNING, encoder=Encoder("x264", False, "mpp-h265", "no device")
    )
    fault = found(snapshot(board(), running))["preview.fallback"]
    for part in ("x264", "mpp-h265", "no device", "own processor"):
        assert part in fault.message


@pytest.mark.parametrize(
    ("encoder", "remedy"),
    [
        (
            Encoder("x264", False, "mpp-h265", "no device"),
            "No hardware encoder here? Set encoders.order: [x264] in the preview's configuration. "
            "Else type on the robot: robot-preview encoders",
        ),
        (Encoder("va-h264", True, "va-h265", "no device"), "Type on the robot: robot-preview encoders"),
    ],
)
def test_the_way_to_the_wanted_encoder_or_without_one(encoder: Encoder, remedy: str) -> None:
    """A computer without a hardware encoder keeps the fault until its owner says that it has none."""
    running = replace(OFF, state=PreviewState.RUNNING, encoder=encoder)
    assert found(snapshot(board(), running))["preview.fallback"].remedy == remedy


def test_a_wanted_camera_that_fails_is_a_fault_that_says_what_is_shown() -> None:
    cameras = (Camera("front", CameraState.FAILED, "it has ended"), Camera("rear", CameraState.LIVE))
    running = replace(OFF, state=PreviewState.RUNNING, wanted_camera="front", cameras=cameras)
    fault = found(snapshot(board(), running))["preview.camera.front"]
    assert fault.severity is Severity.WARNING
    assert fault.message == "camera front does not work, and camera rear is shown instead: it has ended"
    assert "robotctl preview on --camera front" in fault.remedy
    again = replace(running, cameras=(Camera("front", CameraState.STARTING), cameras[1]))
    assert set(found(snapshot(board(), again), frozenset({"preview.camera.front"}))) == {
        "preview.camera.front"
    }
    assert found(snapshot(board(), again)) == {}, "the operator has just chosen it"
    assert found(snapshot(board(), again), frozenset({"preview.camera.rear"})) == {}, "another one had failed"
    assert found(snapshot(board(), replace(running, wanted_camera="rear"))) == {}
    assert found(snapshot(board(), replace(running, state=PreviewState.DISABLED))) == {}


@given(
    raise_at=st.floats(-100, 100),
    gap=st.floats(0.5, 50),
    values=st.lists(st.floats(-200, 200), max_size=30),
    upper=st.booleans(),
)
def test_hysteresis_changes_its_mind_only_beyond_the_other_limit(
    raise_at: float, gap: float, values: list[float], upper: bool
) -> None:
    limit = Limit(raise_at, raise_at - gap if upper else raise_at + gap)
    sign, broken = (1 if upper else -1), False
    for value in values:
        before, broken = broken, limit.broken(value, was_broken=broken)
        if broken and not before:
            assert sign * value >= sign * limit.raise_at
        if before and not broken:
            assert sign * value <= sign * limit.clear_at


def test_limits_without_a_gap_are_refused_with_both_numbers() -> None:
    with pytest.raises(ValidationError, match=r"clear_at \(85\) must be below raise_at \(85\)"):
        UpperLimit(raise_at=85, clear_at=85)
    with pytest.raises(ValidationError, match=r"clear_at \(10\) must be above raise_at \(20\)"):
        LowerLimit(raise_at=20, clear_at=10)
    assert FaultSettings().platform_limits() == LIMITS


def test_a_tilted_robot_with_hysteresis() -> None:
    def tilted(roll_deg: float | None, *active: str) -> set[str]:
        of = board()
        of[ORIENTATION] = Received(Orientation(roll_deg, 0.0 if roll_deg is not None else None, 0.0), NOW_S)
        return set(found(snapshot(of, orientation=False), frozenset(active)))

    assert tilted(29.0) == set()
    assert tilted(-31.0) == {"orientation.tilt"}
    assert tilted(27.0, "orientation.tilt") == {"orientation.tilt"}
    assert tilted(None, "orientation.tilt") == {"orientation.tilt"}, "not known to stand level again"
    assert tilted(24.0, "orientation.tilt") == set()


@pytest.mark.parametrize(("required", "severity"), [(False, Severity.WARNING), (True, Severity.ERROR)])
def test_a_receiver_without_a_position(required: bool, severity: Severity) -> None:
    of = board()
    of[POSITION] = Received(Position(Fix.NONE, None, None, None, None, None), NOW_S)
    assert {each.fault_id: each.severity for each in found(snapshot(of, position=required)).values()} == {
        "position.no_fix": severity
    }
    of[POSITION] = Received(Position(None, 48.0, 11.0, None, None, None), NOW_S)
    assert found(snapshot(of, position=required)) == {}
