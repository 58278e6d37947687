"""Every value of a snapshot arrives at its path of the contract; numbers and texts are unique, flags flipped.

tests/unit/console/client/test_mapping_totality.py does the same for the way from the contract to the client.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from google.protobuf.message import Message

from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.interceptors.stats import MethodStats
from gateway.rpc.mapping.info import gateway_info
from gateway.rpc.mapping.status import NOT_MAPPED, overlay_snapshot
from gateway.status.board import Board
from gateway.status.event_log import OperatorEvent
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.pictures import Pictures
from gateway.status.preview import (
    Camera,
    CameraState,
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    PreviewView,
    Profile,
    Stream,
)
from gateway.status.snapshot import (
    Identity,
    Noted,
    Programs,
    Rules,
    Runtime,
    Setup,
    Snapshot,
    SourceRule,
    take,
)
from gateway.status.sources import (
    BATTERY,
    COMPUTE,
    DETECTIONS,
    EFFECTIVE_COMMAND,
    MODE,
    MUX_INPUTS,
    NETWORK,
    ODOMETRY,
    ONBOARD_BATTERY,
    ORIENTATION,
    POSITION,
    SOURCES,
    VISION,
    SourceSpec,
)
from gateway.status.values import (
    Battery,
    CommandSource,
    Compute,
    Detection,
    Detections,
    Fix,
    Mode,
    Network,
    Orientation,
    Position,
    Received,
    Velocity,
    Vision,
)
from omniseer.gateway.v1 import fault_pb2, pose_pb2, preview_pb2, source_pb2, states_pb2, teleop_pb2
from tests.support.drive_views import stopped_view

NOW_S = 1000.0
CALLER = Recipient(robot_host="10.1.2.3", sees_passphrase=True)
COMMAND = Velocity(0.125, -0.25, 0.75)

# Ages differ by source; odometry alone is older than its limit.
VALUES: dict[SourceSpec[Any], tuple[Any, float]] = {
    ODOMETRY: (Velocity(3.0, 4.0, -1.5), 5.0),
    VISION: (Vision(30.0, 29.5, 11.5, 71, 72), 0.5),
    DETECTIONS: (
        Detections(1281, 721, 73, (Detection(74, "a class", 0.625, "a track", 1.25, 2.25, 3.25, 4.25),)),
        0.25,
    ),
    BATTERY: (Battery(True, 15.5, 80.5, True), 0.75),
    MODE: (Mode("a mode"), 0.125),
    EFFECTIVE_COMMAND: (COMMAND, 0.375),
    MUX_INPUTS[CommandSource.KEYBOARD]: (COMMAND, 0.375),
    COMPUTE: (Compute(40.5, 60.5, True, 81, 162, 50.25), 0.625),
    NETWORK: (Network("an interface", True, -61, 63), 0.875),
    POSITION: (Position(Fix.GBAS, 48.5, 11.25, 520.25, 1.75, 2.125), 0.1875),
    ORIENTATION: (Orientation(1.375, -2.375, 90.375), 0.4375),
    ONBOARD_BATTERY: (Battery(True, 12.5, 70.5, True), 0.0625),
}
LIMIT_MS = 1000
RULES = Rules({spec: SourceRule(LIMIT_MS, required=spec is ODOMETRY) for spec in VALUES}, 3000)
ENCODER = Encoder("an encoder", True, "a wanted encoder", "a reason for the encoder")
PREVIEW = PreviewView(
    state=PreviewState.STARTING,
    profile=Profile.HIGH_QUALITY,
    last_error="an error",
    service_reachable=True,
    listener=Listener(7101, 126, "10.0.0.9", -37),
    stream=Stream(1282, 722, 15.25, 1001, Codec.H265, True, "a reason for the rate"),
    encoder=ENCODER,
    measured=Received(Measurement(14.75, 990.5, 91, 12, 180.5, 6.5), NOW_S - 0.5625),
    counters=Counters(92, 93, 94, 95),
    passphrase="a passphrase",
    wanted_camera="a wanted camera",
    cameras=(Camera("a camera", CameraState.FAILED, "an error of the camera", "a fallback"),),
)


def snapshot(
    *, preview: PreviewView = PREVIEW, insecure: bool = True, now_s: float = NOW_S, **values: Any
) -> Snapshot:
    """Returns a snapshot with everything in it; `values` replace those of sources, by name."""
    board = {
        spec: Received(values.get(spec.name, value), NOW_S - age_s) for spec, (value, age_s) in VALUES.items()
    }
    conditions = [
        Condition(f"id {n}", Severity.WARNING, f"part {n}", f"fault {n}", f"remedy {n}") for n in (1, 2)
    ]
    noted = Noted(
        events=(OperatorEvent(201, NOW_S - 202, "an event"),),
        faults=(
            Fault(conditions[0], NOW_S - 207, NOW_S, None, 208),
            Fault(conditions[1], NOW_S - 209, NOW_S - 210, NOW_S - 210, 211),
        ),
        gateway=Runtime("a revision", "a boot", 203, 204, 205, 206, "a run"),
        pictures=Pictures(82, 141, 139, direct_count=83, srt_latency_count=84, most_given_up=85),
    )
    setup = Setup(Identity("a name", "a version", insecure=insecure), RULES)
    return take(setup, Board(board), Programs(preview, stopped_view(now_s)), now_s, noted)


def flat(message: Message, above: str = "") -> dict[str, Any]:
    """Returns the values that are set, by path."""
    return dict(_paths(message, above))


def _paths(message: Message, above: str) -> Iterator[tuple[str, Any]]:
    for field, value in message.ListFields():
        parts = (
            [(f"[{index}]", item) for index, item in enumerate(value)] if field.is_repeated else [("", value)]
        )
        for index, item in parts:
            path = f"{above}{field.name}{index}"
            yield from _paths(item, f"{path}.") if field.message_type else [(path, item)]


PLACES: dict[str, Any] = {
    "gateway_name": "a name",
    "gateway_version": "a version",
    "insecure": True,
    "vision.available": True,
    "vision.age_ms": 500,
    "vision.producer_fps": 30.0,
    "vision.consumer_fps": 29.5,
    "vision.last_infer_ms": 11.5,
    "vision.infer_error_count": 71,
    "vision.capture_fatal_error_count": 72,
    "health.state": states_pb2.ROBOT_HEALTH_DEGRADED,
    "health.summary": "odometry stale",
    "health.odom_available": True,
    "health.odom_stale": True,
    "health.odom_age_ms": 5000,
    "health.linear_speed_mps": 5.0,
    "health.angular_speed_rad_s": 1.5,
    "health.measured_vx_mps": 3.0,
    "health.measured_vy_mps": 4.0,
    "health.measured_wz_rad_s": -1.5,
    "effective_command.available": True,
    "effective_command.age_ms": 375,
    "effective_command.vx_mps": 0.125,
    "effective_command.vy_mps": -0.25,
    "effective_command.wz_rad_s": 0.75,
    "effective_command.active_source": "keyboard",
    "position.available": True,
    "position.age_ms": 187,
    "position.fix": pose_pb2.FIX_STATUS_GBAS,
    "position.latitude_deg": 48.5,
    "position.longitude_deg": 11.25,
    "position.altitude_m": 520.25,
    "position.horizontal_accuracy_m": 1.75,
    "position.vertical_accuracy_m": 2.125,
    "orientation.available": True,
    "orientation.age_ms": 437,
    "orientation.roll_deg": 1.375,
    "orientation.pitch_deg": -2.375,
    "orientation.yaw_deg": 90.375,
    "mission.available": True,
    "mission.age_ms": 125,
    "mission.mode": "a mode",
    "platform.compute.available": True,
    "platform.compute.age_ms": 625,
    "platform.compute.cpu_percent": 40.5,
    "platform.compute.cpu_temperature_available": True,
    "platform.compute.cpu_temperature_c": 60.5,
    "platform.compute.thermal_throttled_available": True,
    "platform.compute.thermal_throttled": True,
    "platform.compute.ram_used_bytes": 81,
    "platform.compute.ram_total_bytes": 162,
    "platform.compute.ram_used_percent": 50.0,
    "platform.compute.disk_available": True,
    "platform.compute.disk_used_percent": 50.25,
    "platform.network.available": True,
    "platform.network.age_ms": 875,
    "platform.network.connected": True,
    "platform.network.interface_name": "an interface",
    "platform.network.wifi_signal_available": True,
    "platform.network.wifi_signal_dbm": -61,
    "platform.network.link_quality_available": True,
    "platform.network.link_quality_percent": 63,
    "platform.power.lipo_battery.available": True,
    "platform.power.lipo_battery.age_ms": 750,
    "platform.power.lipo_battery.source": "robot",
    "platform.power.lipo_battery.present": True,
    "platform.power.lipo_battery.voltage_available": True,
    "platform.power.lipo_battery.voltage": 15.5,
    "platform.power.lipo_battery.percentage_available": True,
    "platform.power.lipo_battery.percentage": 80.5,
    "platform.power.lipo_battery.charging_available": True,
    "platform.power.lipo_battery.charging": True,
    "platform.power.onboard_battery.available": True,
    "platform.power.onboard_battery.age_ms": 62,
    "platform.power.onboard_battery.source": "computer",
    "platform.power.onboard_battery.present": True,
    "platform.power.onboard_battery.voltage_available": True,
    "platform.power.onboard_battery.voltage": 12.5,
    "platform.power.onboard_battery.percentage_available": True,
    "platform.power.onboard_battery.percentage": 70.5,
    "platform.power.onboard_battery.charging_available": True,
    "platform.power.onboard_battery.charging": True,
    "preview.state": states_pb2.PREVIEW_STARTING,
    "preview.profile": preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY,
    "preview.last_error": "an error",
    "preview.service_reachable": True,
    "preview.target_bitrate_kbps": 1001,
    "preview.bitrate_reason": "a reason for the rate",
    "preview.endpoint.transport": preview_pb2.STREAM_TRANSPORT_SRT,
    "preview.endpoint.host": "10.1.2.3",
    "preview.endpoint.port": 7101,
    "preview.endpoint.uri": "srt://10.1.2.3:7101?mode=caller&latency=126",
    "preview.endpoint.latency_ms": 126,
    "preview.endpoint.codec": preview_pb2.VIDEO_CODEC_H265,
    "preview.endpoint.container": preview_pb2.STREAM_CONTAINER_MPEG_TS,
    "preview.endpoint.passphrase": "a passphrase",
    "preview.endpoint.encrypted": True,
    "preview.endpoint.capture_offset_ns": -37,
    "preview.wanted_camera": "a wanted camera",
    "preview.cameras[0].name": "a camera",
    "preview.cameras[0].state": preview_pb2.CAMERA_STATE_FAILED,
    "preview.cameras[0].error": "an error of the camera",
    "preview.cameras[0].fallback": "a fallback",
    "preview.encoder.name": "an encoder",
    "preview.encoder.hardware": True,
    "preview.encoder.wanted": "a wanted encoder",
    "preview.encoder.fallback_reason": "a reason for the encoder",
    "preview.encoder.codec": preview_pb2.VIDEO_CODEC_H265,
    "preview.video.width_px": 1282,
    "preview.video.height_px": 722,
    "preview.video.fps": 15.25,
    "preview.measured.available": True,
    "preview.measured.age_ms": 562,
    "preview.measured.fps": 14.75,
    "preview.measured.bitrate_kbps": 990.5,
    "preview.measured.viewer_count": 91,
    "preview.measured.last_frame_age_ms": 12 + 562,
    "preview.measured.worst_rtt_ms": 180.5,
    "preview.measured.worst_loss_percent": 6.5,
    "preview.measured.worst_picture_age_ms": 141,
    "preview.measured.reporting_viewer_count": 82,
    "preview.measured.direct_viewer_count": 83,
    "preview.measured.srt_latency_viewer_count": 84,
    "preview.measured.most_packets_given_up": 85,
    "preview.counters.starts": 92,
    "preview.counters.restarts": 93,
    "preview.counters.faults": 94,
    "preview.counters.fallbacks": 95,
    "faults[0].id": "id 1",
    "faults[0].severity": fault_pb2.FAULT_SEVERITY_WARNING,
    "faults[0].component": "part 1",
    "faults[0].message": "fault 1",
    "faults[0].remedy": "remedy 1",
    "faults[0].active": True,
    "faults[0].age_ms": 207_000,
    "faults[0].times_raised": 208,
    "faults[1].id": "id 2",
    "faults[1].severity": fault_pb2.FAULT_SEVERITY_WARNING,
    "faults[1].component": "part 2",
    "faults[1].message": "fault 2",
    "faults[1].remedy": "remedy 2",
    "faults[1].age_ms": 209_000,
    "faults[1].cleared_age_ms": 210_000,
    "faults[1].times_raised": 211,
    "gateway.revision": "a revision",
    "gateway.boot_id": "a boot",
    "gateway.uptime_ms": 203,
    "gateway.client_count": 204,
    "gateway.requests_served": 205,
    "gateway.requests_refused": 206,
    "gateway.run_id": "a run",
    "teleop.state": states_pb2.TELEOP_ENABLED,
    "teleop.enabled": True,
    "teleop.last_command_available": True,
    "teleop.last_command_stale": True,
    "teleop.last_command_age_ms": 507,
    "teleop.last_command_vx_mps": 0.0625,
    "teleop.last_command_vy_mps": -0.03125,
    "teleop.last_command_wz_rad_s": 0.15625,
    "teleop.max_linear_mps": 0.40625,
    "teleop.max_angular_rad_s": 0.90625,
    "teleop.last_error": "why a command was refused",
    "teleop.phase": teleop_pb2.DRIVE_PHASE_STOPPED,
    "teleop.inhibits[0]": teleop_pb2.DRIVE_INHIBIT_BASE_ABSENT,
    "teleop.inhibits[1]": teleop_pb2.DRIVE_INHIBIT_DRIVE_LOST,
    "teleop.holder": "a driver",
    "teleop.stop.stop_id": 221,
    "teleop.stop.by": "who stopped",
    "teleop.stop.reason": "a reason to stop",
    "teleop.stop.age_ms": 2625,
    "teleop.base_timeout_ms": 1009,
}
"""Path in a SystemStatus, without `sources`, and its value."""

DERIVED = {
    "health.linear_speed_mps": "hypot(vx, vy)",
    "health.angular_speed_rad_s": "|wz|",
    "preview.encoder.codec": "of the stream, as the endpoint's",
}
"""Paths whose value another path may have, too."""


def test_every_value_of_the_status_arrives_at_its_place_and_nowhere_else() -> None:
    status = overlay_snapshot(snapshot(), CALLER).status
    status.ClearField("sources")
    assert flat(status) == PLACES


def test_detections_and_events_arrive_at_their_places() -> None:
    overlay = overlay_snapshot(snapshot(), CALLER)
    assert flat(overlay.detections) == {
        "available": True,
        "age_ms": 250,
        "source_width_px": 1281,
        "source_height_px": 721,
        "detection_count": 73,
        "detections[0].class_id": 74,
        "detections[0].class_name": "a class",
        "detections[0].score": 0.625,
        "detections[0].track_id": "a track",
        "detections[0].bbox_center_x_px": 1.25,
        "detections[0].bbox_center_y_px": 2.25,
        "detections[0].bbox_width_px": 3.25,
        "detections[0].bbox_height_px": 4.25,
    }
    assert [flat(event) for event in overlay.events] == [
        {"sequence": 201, "age_ms": 202_000, "message": "an event"}
    ]


def test_every_source_arrives_with_its_own_freshness() -> None:
    sources = {source.name: flat(source) for source in overlay_snapshot(snapshot(), CALLER).status.sources}
    assert sources.pop("odometry") == {
        "name": "odometry",
        "state": source_pb2.SOURCE_STATE_STALE,
        "available": True,
        "stale": True,
        "age_ms": 5000,
        "required": True,
        "detail": "odometry stopped coming",
    }
    for spec, (_, age_s) in VALUES.items():
        if seen := sources.pop(spec.name, None):
            assert seen == {
                "name": spec.name,
                "state": source_pb2.SOURCE_STATE_RECEIVING,
                "available": True,
                "age_ms": int(age_s * 1000),
            }
    assert not sources


def test_the_gateways_info_arrives_at_its_places() -> None:
    info = gateway_info(
        snapshot(), {"A": MethodStats(301, 302, 303), "B": MethodStats(304, 305, 306)}, 307, "{}"
    )
    assert flat(info) == {
        "gateway_name": "a name",
        "gateway_version": "a version",
        **{path: value for path, value in PLACES.items() if path.startswith("gateway.")},
        "wall_clock_unix_ms": 307,
        "methods[0].method": "A",
        "methods[0].served": 301,
        "methods[0].refused": 302,
        "methods[0].failed": 303,
        "methods[1].method": "B",
        "methods[1].served": 304,
        "methods[1].refused": 305,
        "methods[1].failed": 306,
        "configuration_json": "{}",
    }


FLAGS: list[tuple[str, Callable[[], Snapshot]]] = [
    ("insecure", lambda: snapshot(insecure=False)),
    ("preview.service_reachable", lambda: snapshot(preview=replace(PREVIEW, service_reachable=False))),
    (
        "preview.encoder.hardware",
        lambda: snapshot(preview=replace(PREVIEW, encoder=replace(ENCODER, hardware=False))),
    ),
    (
        "platform.compute.thermal_throttled",
        lambda: snapshot(compute=replace(VALUES[COMPUTE][0], thermal_throttled=False)),
    ),
    ("platform.network.connected", lambda: snapshot(network=replace(VALUES[NETWORK][0], connected=False))),
    (
        "platform.power.lipo_battery.present",
        lambda: snapshot(battery=replace(VALUES[BATTERY][0], present=False)),
    ),
    (
        "platform.power.lipo_battery.charging",
        lambda: snapshot(battery=replace(VALUES[BATTERY][0], charging=False)),
    ),
]


@pytest.mark.parametrize(("path", "flipped"), FLAGS, ids=[path for path, _ in FLAGS])
def test_a_flag_changes_its_own_place_alone(path: str, flipped: Callable[[], Snapshot]) -> None:
    status = overlay_snapshot(flipped(), CALLER).status
    status.ClearField("sources")
    assert flat(status) == {place: value for place, value in PLACES.items() if place != path}


def test_a_healthy_robot_is_ready() -> None:
    health = overlay_snapshot(snapshot(now_s=NOW_S - 4.5), CALLER).status.health
    assert {path: value for path, value in flat(health).items() if not path.endswith(("_mps", "_rad_s"))} == {
        "state": states_pb2.ROBOT_HEALTH_OK,
        "ready": True,
        "summary": "robot healthy",
        "odom_available": True,
        "odom_age_ms": 500,
    }


UNKNOWN: list[tuple[str, Callable[[], Snapshot], set[str]]] = [
    (
        "the computer's temperature",
        lambda: snapshot(compute=replace(VALUES[COMPUTE][0], cpu_temperature_c=None)),
        {"platform.compute.cpu_temperature_available", "platform.compute.cpu_temperature_c"},
    ),
    (
        "its throttling",
        lambda: snapshot(compute=replace(VALUES[COMPUTE][0], thermal_throttled=None)),
        {"platform.compute.thermal_throttled_available", "platform.compute.thermal_throttled"},
    ),
    (
        "its disk",
        lambda: snapshot(compute=replace(VALUES[COMPUTE][0], disk_used_percent=None)),
        {"platform.compute.disk_available", "platform.compute.disk_used_percent"},
    ),
    (
        "the signal",
        lambda: snapshot(network=replace(VALUES[NETWORK][0], wifi_signal_dbm=None)),
        {"platform.network.wifi_signal_available", "platform.network.wifi_signal_dbm"},
    ),
    (
        "the link's quality",
        lambda: snapshot(network=replace(VALUES[NETWORK][0], link_quality_percent=None)),
        {"platform.network.link_quality_available", "platform.network.link_quality_percent"},
    ),
    (
        "the voltage",
        lambda: snapshot(battery=replace(VALUES[BATTERY][0], voltage_v=None)),
        {"platform.power.lipo_battery.voltage_available", "platform.power.lipo_battery.voltage"},
    ),
    (
        "the charge",
        lambda: snapshot(battery=replace(VALUES[BATTERY][0], charge_percent=None)),
        {"platform.power.lipo_battery.percentage_available", "platform.power.lipo_battery.percentage"},
    ),
    (
        "whether it charges",
        lambda: snapshot(battery=replace(VALUES[BATTERY][0], charging=None)),
        {"platform.power.lipo_battery.charging_available", "platform.power.lipo_battery.charging"},
    ),
]


@pytest.mark.parametrize(
    ("changed", "absent"), [case[1:] for case in UNKNOWN], ids=[case[0] for case in UNKNOWN]
)
def test_an_unknown_value_leaves_its_own_places_alone_unset(
    changed: Callable[[], Snapshot], absent: set[str]
) -> None:
    status = overlay_snapshot(changed(), CALLER).status
    status.ClearField("sources")
    assert flat(status) == {place: value for place, value in PLACES.items() if place not in absent}


def test_numbers_and_texts_are_unique() -> None:
    """Two equal values could change places unseen."""
    values = Counter(
        value
        for path, value in PLACES.items()
        if type(value) is not bool
        and path not in DERIVED
        and not path.endswith(
            (".state", ".severity", ".profile", ".transport", ".container", ".codec", ".fix")
        )
    )
    assert [value for value, count in values.items() if count > 1] == []


def test_every_source_that_the_contract_has_a_field_for_is_filled() -> None:
    assert set(SOURCES) - set(VALUES) <= NOT_MAPPED
