"""Every value of every message of the contract arrives at its place in a result, and nowhere else.

The tables below say where: a field goes to the attribute of its own name unless they say otherwise.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass
from enum import Enum
from functools import partial
from itertools import chain
from math import isfinite
from typing import Any, Final

import pytest
from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from console.client import results
from console.client.mapping import enums, recording
from console.client.mapping.driving import (
    DriveCommand,
    command_request,
    enabled_request,
    join_request,
    open_request,
    reset_request,
    stop_request,
    velocity_request,
)
from console.client.mapping.methods import (
    DRIVE,
    METHODS,
    STREAMS,
    SUBSCRIBE_EVENTS,
    DesiredPreview,
    Method,
    events_request,
    key_frame_request,
    picture_request,
    preview_request,
    watch_request,
)
from console.client.results import (
    Event,
    EventKind,
    EventPosition,
    FaultSeverity,
    PictureDelivery,
    PictureReport,
    PreviewProfile,
)
from omniseer.gateway.v1 import (
    cloud_pb2,
    event_pb2,
    fault_pb2,
    gateway_info_pb2,
    overlay_pb2,
    platform_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    robot_gateway_pb2,
    source_pb2,
    states_pb2,
    system_status_pb2,
    teleop_pb2,
    value_pb2,
)
from tests.support.control_characters import CONTROL_CHARACTERS, change_texts
from tests.support.filled import alternatives, changes, fields_of, fill_distinctly, is_alternative

FILES: Final = (
    cloud_pb2,
    event_pb2,
    source_pb2,
    fault_pb2,
    gateway_info_pb2,
    overlay_pb2,
    platform_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    robot_gateway_pb2,
    states_pb2,
    system_status_pb2,
    teleop_pb2,
    value_pb2,
)
ANSWERS: Final = {
    method.name: method
    for service in (
        robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"],
        teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"],
        recording_pb2.DESCRIPTOR.services_by_name["RecordingService"],
    )
    for method in service.methods
}
"""Every method of the contract by its name, which no other has."""
ALL_METHODS: Final[tuple[Method[Any], ...]] = (*METHODS, *STREAMS, DRIVE)
DECODERS: Final = {method.name: method.decode for method in ALL_METHODS}

ENUM_MAPPINGS: Final[Mapping[str, Callable[[int], Enum]]] = {
    wire.DESCRIPTOR.name: partial(enums.member, members, wire.DESCRIPTOR)
    for members, wire in (
        (results.ControlResult, event_pb2.ControlResult),
        (results.GapReason, event_pb2.EventGapReason),
        (results.PreviewState, states_pb2.PreviewState),
        (results.SourceState, source_pb2.SourceState),
        (results.FixStatus, pose_pb2.FixStatus),
        (results.NumberLevel, value_pb2.NumberLevel),
        (results.TextLevel, value_pb2.TextLevel),
        (results.FaultSeverity, fault_pb2.FaultSeverity),
        (results.HealthState, states_pb2.RobotHealthState),
        (results.TeleopState, states_pb2.TeleopState),
        (results.PreviewProfile, preview_pb2.PreviewProfile),
        (results.PictureDelivery, preview_pb2.PictureDelivery),
        (results.CameraState, preview_pb2.CameraState),
        (results.VideoCodec, preview_pb2.VideoCodec),
        (results.StreamTransport, preview_pb2.StreamTransport),
        (results.StreamContainer, preview_pb2.StreamContainer),
        (results.DrivePhase, teleop_pb2.DrivePhase),
        (results.DriveInhibit, teleop_pb2.DriveInhibit),
        (results.Supervision, teleop_pb2.Supervision),
        (results.RecorderState, recording_pb2.RecorderState),
        (results.RecordingKind, recording_pb2.RecordingKind),
        (results.RecordingState, recording_pb2.RecordingState),
        (results.RecordingStopReason, recording_pb2.RecordingStopReason),
        (results.RecordingCopyState, recording_pb2.RecordingCopyState),
        (results.RecordingGapCause, recording_pb2.RecordingGapCause),
        (results.RecordingChange, event_pb2.RecordingChange),
        (results.CloudState, cloud_pb2.CloudState),
    )
}

LEFT_OUT: Final[Mapping[str, str]] = dict.fromkeys(
    (
        "ComputeStatus.cpu_temperature_available",
        "ComputeStatus.thermal_throttled_available",
        "ComputeStatus.disk_available",
        "NetworkStatus.wifi_signal_available",
        "NetworkStatus.link_quality_available",
        "BatteryStatus.voltage_available",
        "BatteryStatus.percentage_available",
        "BatteryStatus.charging_available",
    ),
    "a flag of one value, which is None instead (see PRESENCE)",
)
"""Fields on purpose without a place of their own in the results -> reason."""

RENAMED: Final[Mapping[str, str]] = {
    "BatteryStatus.voltage": "voltage_v",
    "BatteryStatus.percentage": "charge_percent",
    "DetectionOverlayStatus.detection_count": "count",
    "DetectionOverlayStatus.detections": "items",
    "OverlayDetection.bbox_center_x_px": "center_x_px",
    "OverlayDetection.bbox_center_y_px": "center_y_px",
    "OverlayDetection.bbox_width_px": "width_px",
    "OverlayDetection.bbox_height_px": "height_px",
    "RobotHealth.state": "health.state",
    "RobotHealth.ready": "health.ready",
    "RobotHealth.summary": "health.summary",
    "RobotHealth.odom_available": "odometry.available",
    "RobotHealth.odom_stale": "odometry.stale",
    "RobotHealth.odom_age_ms": "odometry.age_ms",
    "RobotHealth.linear_speed_mps": "odometry.linear_speed_mps",
    "RobotHealth.angular_speed_rad_s": "odometry.angular_speed_rad_s",
    "RobotHealth.measured_vx_mps": "odometry.vx_mps",
    "RobotHealth.measured_vy_mps": "odometry.vy_mps",
    "RobotHealth.measured_wz_rad_s": "odometry.wz_rad_s",
    "TeleopStatus.last_command_available": "last_command.available",
    "TeleopStatus.last_command_stale": "last_command.stale",
    "TeleopStatus.last_command_age_ms": "last_command.age_ms",
    "TeleopStatus.last_command_vx_mps": "last_command.vx_mps",
    "TeleopStatus.last_command_vy_mps": "last_command.vy_mps",
    "TeleopStatus.last_command_wz_rad_s": "last_command.wz_rad_s",
    "Event.run_id": "position.run_id",
    "Event.sequence": "position.sequence",
    "Event.preview_state_changed": "preview",
    "Event.control_action": "control",
    "Event.recording_state_changed": "recording",
    "Event.cloud_state_changed": "cloud",
    "Event.recording_copy_changed": "recording_copy",
    "ClientJoined.address": "client_address",
    "ClientLeft.address": "client_address",
    "ClientJoined.who": "client_name",
    "ClientLeft.who": "client_name",
    "SubscribeEventsResponse.caught_up": "position",
}
"""Field -> its place in the result of its message, where that is not its own name."""

INLINED: Final = {
    "SystemStatus.health",
    "SubscribeEventsResponse.event",
    "SubscribeEventsResponse.gap",
    "DriveResponse.opened",
    "DriveResponse.state",
    "ExportRecordingResponse.header",
    "ExportRecordingResponse.chunk",
    "Event.fault_raised",
    "Event.fault_cleared",
    "Event.client_joined",
    "Event.client_left",
    "Event.robot_mode_changed",
}
"""Submessages without an object of their own: their fields stand in the result of the message around them."""

POSITION_PARTS: Final = (
    "latitude_deg",
    "longitude_deg",
    "altitude_m",
    "horizontal_accuracy_m",
    "vertical_accuracy_m",
)
ANGLES: Final = ("roll_deg", "pitch_deg", "yaw_deg")
NUMBER_LIMITS: Final = ("error_below", "warning_below", "warning_above", "error_above")
PRESENCE: Final[Mapping[str, tuple[str, ...]]] = {
    "VisionStatus.available": (
        "age_ms",
        "producer_fps",
        "consumer_fps",
        "last_infer_ms",
        "infer_error_count",
        "capture_fatal_error_count",
    ),
    "RobotHealth.odom_available": (
        "odometry.age_ms",
        "odometry.linear_speed_mps",
        "odometry.angular_speed_rad_s",
        "odometry.vx_mps",
        "odometry.vy_mps",
        "odometry.wz_rad_s",
    ),
    "TeleopStatus.last_command_available": (
        "last_command.age_ms",
        "last_command.vx_mps",
        "last_command.vy_mps",
        "last_command.wz_rad_s",
    ),
    "EffectiveCommand.available": ("age_ms", "vx_mps", "vy_mps", "wz_rad_s", "active_source"),
    "MissionStatus.available": ("age_ms", "mode"),
    "PositionStatus.available": ("age_ms", *POSITION_PARTS),
    **{f"PositionStatus.{name}": (name,) for name in POSITION_PARTS},
    "OrientationStatus.available": ("age_ms", *ANGLES),
    **{f"OrientationStatus.{name}": (name,) for name in ANGLES},
    "NumberStatus.available": ("age_ms", "value", "decimals", *NUMBER_LIMITS),
    "NumberStatus.value": ("value",),
    "TextStatus.available": ("age_ms", "text"),
    "TextStatus.text": ("text",),
    "NumberStatus.decimals": ("decimals",),
    **{f"NumberStatus.{name}": (name,) for name in NUMBER_LIMITS},
    "SourceStatus.available": ("age_ms",),
    "ComputeStatus.available": (
        "age_ms",
        "cpu_percent",
        "cpu_temperature_c",
        "thermal_throttled",
        "ram_used_bytes",
        "ram_total_bytes",
        "ram_used_percent",
        "disk_used_percent",
    ),
    "ComputeStatus.cpu_temperature_available": ("cpu_temperature_c",),
    "ComputeStatus.thermal_throttled_available": ("thermal_throttled",),
    "ComputeStatus.disk_available": ("disk_used_percent",),
    "NetworkStatus.available": (
        "age_ms",
        "connected",
        "interface_name",
        "wifi_signal_dbm",
        "link_quality_percent",
    ),
    "NetworkStatus.wifi_signal_available": ("wifi_signal_dbm",),
    "NetworkStatus.link_quality_available": ("link_quality_percent",),
    "BatteryStatus.available": ("age_ms", "source", "present", "voltage_v", "charge_percent", "charging"),
    "BatteryStatus.voltage_available": ("voltage_v",),
    "BatteryStatus.percentage_available": ("charge_percent",),
    "BatteryStatus.charging_available": ("charging",),
    "StreamMeasurement.available": (
        "age_ms",
        "fps",
        "bitrate_kbps",
        "viewer_count",
        "last_frame_age_ms",
        "worst_rtt_ms",
        "worst_loss_percent",
        "worst_picture_age_ms",
        "reporting_viewer_count",
        "direct_viewer_count",
        "srt_latency_viewer_count",
        "most_packets_given_up",
    ),
    "StreamMeasurement.last_frame_age_ms": ("last_frame_age_ms",),
    "StreamMeasurement.worst_rtt_ms": ("worst_rtt_ms",),
    "StreamMeasurement.worst_loss_percent": ("worst_loss_percent",),
    "StreamMeasurement.worst_picture_age_ms": ("worst_picture_age_ms",),
    "StreamMeasurement.most_packets_given_up": ("most_packets_given_up",),
    "StreamEndpoint.capture_offset_ns": ("capture_offset_ns",),
    "Fault.cleared_age_ms": ("cleared_age_ms",),
    "PreviewStatus.endpoint": ("endpoint",),
    "PreviewStatus.encoder": ("encoder",),
    "PreviewStatus.video": ("video",),
    "SystemStatus.gateway": (
        "gateway.uptime_ms",
        "gateway.client_count",
        "gateway.requests_served",
        "gateway.requests_refused",
    ),
    "GetGatewayInfoResponse.gateway": (
        "gateway.uptime_ms",
        "gateway.client_count",
        "gateway.requests_served",
        "gateway.requests_refused",
    ),
    "DetectionOverlayStatus.available": ("age_ms", "source_width_px", "source_height_px", "count"),
    "WatchSystemStatusResponse.detections": ("detections",),
    "TeleopStatus.stop": ("stop",),
    "TeleopStatus.base_timeout_ms": ("base_timeout_ms",),
    "SystemStatus.recording": ("recording",),
    "SystemStatus.cloud": ("cloud",),
    "CloudStatus.last_sent_age_ms": ("last_sent_age_ms",),
    "CloudStatus.uploading": ("uploading",),
    "RecordingStatus.messages_lost": ("messages_lost",),
    "RecordingStatus.room_s": ("room_s",),
    "Recording.messages_lost": ("messages_lost",),
    "RecordingGap.messages": ("messages",),
    "RecordingStateChanged.messages_lost": ("messages_lost",),
    "DriveState.stop": ("stop",),
    "DriveState.picture_age_ms": ("picture_age_ms",),
    "DriveState.turn_limit_rad_s": ("turn_limit_rad_s",),
}
"""Flag that may be down, or field that may be unset -> what is None then in the result of its message."""

LIST_PRESENCE: Final[Mapping[str, tuple[str, ...]]] = {"DetectionOverlayStatus.available": ("items",)}
"""Flag -> the lists that become empty when it is down."""

EMPTY_IS_UNKNOWN: Final = {
    "GatewayFacts.revision",
    "GatewayFacts.boot_id",
    "GatewayFacts.run_id",
    "PingResponse.boot_id",
}
"""Texts that are None in the result when they are empty."""

INFINITE_IS_KEPT: Final = {
    *(f"DriveLimits.{field.name}" for field in teleop_pb2.DriveLimits.DESCRIPTOR.fields),
    "DriveState.vx_mps",
    "DriveState.vy_mps",
    "DriveState.wz_rad_s",
    "DriveState.speed_limit_mps",
    "TeleopStatus.max_linear_mps",
    "TeleopStatus.max_angular_rad_s",
    "VideoFormat.fps",
    "OverlayDetection.score",
    "OverlayDetection.bbox_center_x_px",
    "OverlayDetection.bbox_center_y_px",
    "OverlayDetection.bbox_width_px",
    "OverlayDetection.bbox_height_px",
}
"""Floats that are never None in the result; all others are None when they are not finite."""

EVENT_KINDS: Final[Mapping[str, EventKind]] = {
    "fault_raised": EventKind.FAULT_RAISED,
    "fault_cleared": EventKind.FAULT_CLEARED,
    "preview_state_changed": EventKind.PREVIEW,
    "encoder_fallback": EventKind.ENCODER_FALLBACK,
    "client_joined": EventKind.CLIENT_JOINED,
    "client_left": EventKind.CLIENT_LEFT,
    "control_action": EventKind.CONTROL,
    "robot_mode_changed": EventKind.MODE,
    "recording_state_changed": EventKind.RECORDING,
    "cloud_state_changed": EventKind.CLOUD,
    "recording_copy_changed": EventKind.RECORDING_COPY,
}
"""Payload of an event -> `Event.kind`, which no field feeds."""

EVENT_PARTS: Final = (
    "fault",
    "preview",
    "encoder_fallback",
    "client_address",
    "client_name",
    "control",
    "mode",
    "recording",
    "cloud",
    "recording_copy",
)
"""The parts of an `Event` that its payload feeds; those of other payloads are None."""

UNIQUE_TYPES: Final = (int, float, str, bytes)
"""The types with enough values for each field to have its own; flags and enumerations have too few."""

Flat = dict[str, object]
"""Values by their places: "preview.encoder.name", "faults[0].id"."""


class Nothing:
    """Stands in a report for the value of a place that does not exist."""

    def __repr__(self) -> str:
        return "nothing"


NOTHING: Final = Nothing()


def short_name(field: FieldDescriptor) -> str:
    """A field as the tables call it: "EncoderStatus.name". All messages of the contract share a package."""
    return ".".join(field.full_name.split(".")[-2:])


def below(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name


def is_within(place: str, outer: str) -> bool:
    return place == outer or place.startswith((f"{outer}.", f"{outer}["))


def flatten(result: object, place: str = "") -> Flat:
    """All values of a result by their places. An empty tuple is a value."""
    if is_dataclass(result):
        parts = [(below(place, each.name), getattr(result, each.name)) for each in fields(result)]
    elif isinstance(result, tuple) and result:
        parts = [(f"{place}[{index}]", item) for index, item in enumerate(result)]
    else:
        return {place: result}
    return {key: value for name, part in parts for key, value in flatten(part, name).items()}


def expected(message: Message, place: str = "") -> Flat:
    """All values that the result of a message should have, as the tables say.

    Args:
        message: an answer or a part of one.
        place: where its result stands in the result of the whole answer.
    """
    flat: Flat = {}
    for field in fields_of(message):
        if is_alternative(field) and not message.HasField(field.name):
            continue
        arriving = expected_of_field(message, field, place)
        shared = flat.keys() & arriving.keys()
        assert not shared, f"{short_name(field)} and another field are both expected at {shared}"
        flat |= arriving
    if isinstance(message, event_pb2.Event):
        add_event_kind(flat, message, place)
    hide_absent(flat, message, place)
    return flat


def expected_of_field(message: Message, field: FieldDescriptor, place: str) -> Flat:
    """What one field brings into the result."""
    name = short_name(field)
    if name in LEFT_OUT:
        return {}
    destination = place if name in INLINED else below(place, RENAMED.get(name, field.name))
    value = getattr(message, field.name)
    if not field.message_type and field.is_repeated:
        items = {f"{destination}[{index}]": expected_value(field, item) for index, item in enumerate(value)}
        return items or {destination: ()}
    if not field.message_type:
        return {destination: expected_value(field, value)}
    if not field.is_repeated:
        return expected(value, destination)
    parts = [expected(item, f"{destination}[{index}]") for index, item in enumerate(value)]
    return dict(chain.from_iterable(part.items() for part in parts)) if parts else {destination: ()}


def expected_value(field: FieldDescriptor, value: object) -> object:
    """A field's value as a result holds it."""
    if field.enum_type:
        assert isinstance(value, int)
        return ENUM_MAPPINGS[field.enum_type.name](value)
    if isinstance(value, float) and not isfinite(value):
        return value if short_name(field) in INFINITE_IS_KEPT else None
    if isinstance(value, float):
        return round(value, 6)  # what was -0.1 before 32 bits held it is -0.1 again
    return None if value == "" and short_name(field) in EMPTY_IS_UNKNOWN else value


def add_event_kind(flat: Flat, event: event_pb2.Event, place: str) -> None:
    """Adds what depends on which payload an event has, rather than on a field."""
    flat[below(place, "kind")] = EVENT_KINDS[str(event.WhichOneof("payload"))]
    for part in (below(place, name) for name in EVENT_PARTS):
        if not any(is_within(key, part) for key in flat):
            flat[part] = None


def hide_absent(flat: Flat, message: Message, place: str) -> None:
    """Replaces the values that are not known, because a flag is down or a field is unset."""
    for field in fields_of(message):
        if not is_present(message, field):
            for hidden in PRESENCE.get(short_name(field), ()):
                replace(flat, below(place, hidden), None)
            for hidden in LIST_PRESENCE.get(short_name(field), ()):
                replace(flat, below(place, hidden), ())


def is_present(message: Message, field: FieldDescriptor) -> bool:
    return message.HasField(field.name) if field.has_presence else bool(getattr(message, field.name))


def replace(flat: Flat, place: str, value: object) -> None:
    """Puts one value in the place of all values there and below."""
    for key in [key for key in flat if is_within(key, place)]:
        del flat[key]
    flat[place] = value


def mismatches(wanted: Flat, found: Flat) -> Iterator[str]:
    for place in sorted(wanted.keys() | found.keys()):
        want, got = wanted.get(place, NOTHING), found.get(place, NOTHING)
        # The type counts: True equals 1, and 7.0 equals 7.
        if type(want) is not type(got) or want != got:
            yield f"expected {want!r} at {place}, found {got!r}"


CASES: Final = [
    (method.name, members)
    for method in ANSWERS.values()
    if method.output_type.fields
    for members in alternatives(method.output_type)
]
"""Every method with fields in its answer, with every choice of members of the oneofs of its answer."""


def case_id(method: str, members: tuple[str, ...]) -> str:
    """As in "SubscribeEvents.event.fault_raised"."""
    return ".".join([method, *(name.rpartition(".")[2] for name in members)])


def filled_answer(method: str, members: tuple[str, ...]) -> Message:
    answer = GetMessageClass(ANSWERS[method].output_type)()
    fill_distinctly(answer, members)
    return answer


@pytest.mark.parametrize(("method", "members"), [pytest.param(*case, id=case_id(*case)) for case in CASES])
def test_every_value_of_an_answer_arrives_at_its_place_and_nowhere_else(
    method: str, members: tuple[str, ...]
) -> None:
    answer = filled_answer(method, members)
    first_seen: dict[str, str] = {}  # one mistake shows in many changes: report it once
    for change in chain(["all as filled"], changes(answer)):
        found = flatten(DECODERS[method](answer.SerializeToString()))
        for mismatch in mismatches(expected(answer), found):
            first_seen.setdefault(mismatch, change)
    if first_seen:
        lines = [f"{change}: {mismatch}" for mismatch, change in first_seen.items()]
        pytest.fail(
            "\n  ".join([f"{case_id(method, members)}: {len(lines)} mismatches", *lines]), pytrace=False
        )


@pytest.mark.parametrize(("method", "members"), [pytest.param(*case, id=case_id(*case)) for case in CASES])
def test_no_text_of_an_answer_holds_a_control_character(method: str, members: tuple[str, ...]) -> None:
    answer = filled_answer(method, members)
    change_texts(answer, lambda text: f"{text}{CONTROL_CHARACTERS}")
    texts = {
        place: value
        for place, value in flatten(DECODERS[method](answer.SerializeToString())).items()
        if isinstance(value, str)
    }
    texts["configuration_json"] = texts.get("configuration_json", "").replace("\n", "")
    assert {place: text for place, text in texts.items() if set(text) & set(CONTROL_CHARACTERS)} == {}


def fields_set(message: Message) -> Iterator[FieldDescriptor]:
    """All fields that are set in a message and below it."""
    for field, value in message.ListFields():
        yield field
        if field.message_type:
            for item in value if field.is_repeated else [value]:
                yield from fields_set(item)


def answer_fields() -> set[str]:
    """The full names of all fields that the cases above fill."""
    return {field.full_name for case in CASES for field in fields_set(filled_answer(*case))}


def answer_messages() -> set[str]:
    """The full names of all messages that the cases above fill."""
    return {name.rpartition(".")[0] for name in answer_fields()}


def test_an_answer_without_fields_has_no_result() -> None:
    without = [method.name for method in ANSWERS.values() if not method.output_type.fields]
    assert {name: DECODERS[name](b"") for name in without} == {"ReportPicture": None}


def test_every_field_of_an_answer_is_filled_in_a_case() -> None:
    """A member of a oneof that no case fills would escape the test above."""
    declared = {
        field.full_name
        for file in FILES
        for message in file.DESCRIPTOR.message_types_by_name.values()
        if message.full_name in answer_messages()
        for field in message.fields
    }
    assert answer_fields() == declared


def test_the_numbers_and_texts_of_an_answer_are_unique() -> None:
    """Two equal values could change places unseen."""
    for case in CASES:
        values = [value for value in expected(filled_answer(*case)).values() if type(value) in UNIQUE_TYPES]
        assert len(set(values)) == len(values)


def test_the_tables_name_only_fields_of_answers() -> None:
    named = {*LEFT_OUT, *RENAMED, *INLINED, *PRESENCE, *LIST_PRESENCE, *EMPTY_IS_UNKNOWN, *INFINITE_IS_KEPT}
    assert named <= {".".join(name.split(".")[-2:]) for name in answer_fields()}


def test_every_field_of_a_preview_request_is_set() -> None:
    request = robot_gateway_pb2.SetPreviewModeRequest.FromString(
        preview_request(DesiredPreview(True, PreviewProfile.HIGH_QUALITY, "rear"))
    )
    assert request.enabled
    assert request.profile == preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY
    assert request.camera == "rear"
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_every_field_of_a_subscription_is_set() -> None:
    request = robot_gateway_pb2.SubscribeEventsRequest.FromString(
        events_request(EventPosition("run", 7), FaultSeverity.ERROR)
    )
    assert (request.after.run_id, request.after.sequence) == ("run", 7)
    assert request.min_severity == fault_pb2.FAULT_SEVERITY_ERROR
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_every_field_of_a_watch_is_set() -> None:
    request = robot_gateway_pb2.WatchSystemStatusRequest.FromString(
        watch_request(0.25, include_detections=True)
    )
    assert request.min_interval_ms == 250
    assert request.include_detections
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_every_field_of_a_key_frame_request_is_set() -> None:
    request = robot_gateway_pb2.RequestKeyFrameRequest.FromString(key_frame_request(7))
    assert request.newest_pts == 7
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)
    unknown = robot_gateway_pb2.RequestKeyFrameRequest.FromString(key_frame_request(None))
    assert not unknown.HasField("newest_pts")


def test_every_field_of_a_picture_report_is_set() -> None:
    report = PictureReport(
        viewer_id="left",
        picture_age_ms=140,
        picture_age_error_ms=2,
        rtt_ms=21,
        loss_percent=2.5,
        packets_held=300,
        packets_given_up=4,
        delivery=PictureDelivery.DIRECT,
        link_age_ms=90,
    )
    request = robot_gateway_pb2.ReportPictureRequest.FromString(picture_request(report))
    found = {field.name: value for field, value in request.ListFields()}
    expected = asdict(report) | {"delivery": preview_pb2.PICTURE_DELIVERY_DIRECT}
    assert found == expected
    assert set(found) == set(request.DESCRIPTOR.fields_by_name)
    short = robot_gateway_pb2.ReportPictureRequest.FromString(
        picture_request(PictureReport(picture_age_ms=9))
    )
    assert {field.name for field, _ in short.ListFields()} == {"picture_age_ms"}


def test_every_field_of_the_requests_of_driving_is_set() -> None:
    command = DriveCommand(
        sequence=1,
        held=True,
        vx_mps=0.25,
        vy_mps=0.5,
        wz_rad_s=0.75,
        echo_monotonic_ns=2,
        picture_monotonic_ns=3,
        valid_until_monotonic_ns=4,
        input_device="gamepad",
    )
    request = teleop_pb2.DriveRequest.FromString(command_request(command)).command
    assert {field.name: value for field, value in request.ListFields()} == asdict(command)
    assert set(asdict(command)) == set(request.DESCRIPTOR.fields_by_name)
    opening = teleop_pb2.DriveRequest.FromString(
        open_request("a" * 99, results.Supervision.LINE_OF_SIGHT, take_over=True)
    ).open
    assert opening == teleop_pb2.DriveOpen(
        client_name="a" * 64, take_over=True, supervision=teleop_pb2.SUPERVISION_LINE_OF_SIGHT
    )
    joining = teleop_pb2.DriveRequest.FromString(join_request("tool", "session")).open
    assert joining == teleop_pb2.DriveOpen(client_name="tool", session_id="session")
    stop = teleop_pb2.StopRobotRequest.FromString(stop_request("id", "why"))
    assert (stop.request_id, stop.reason) == ("id", "why")
    assert teleop_pb2.ResetStopRequest.FromString(reset_request(7)).stop_id == 7
    assert robot_gateway_pb2.SetTeleopEnabledRequest.FromString(enabled_request(True)).enabled
    velocity = robot_gateway_pb2.SendTeleopCommandRequest.FromString(velocity_request(0.25, 0.5, 0.75))
    assert (velocity.linear_x_mps, velocity.linear_y_mps, velocity.angular_z_rad_s) == (0.25, 0.5, 0.75)


def test_every_field_of_the_requests_of_recordings_is_set() -> None:
    requests: dict[type[Message], bytes] = {
        recording_pb2.StartRecordingRequest: recording.start_request(
            "id",
            label="label",
            notes="notes",
            preset="preset",
            with_video=False,
            max_duration_s=1,
            max_bytes=2,
        ),
        recording_pb2.StopRecordingRequest: recording.stop_request("id", "recording"),
        recording_pb2.TriggerSnapshotRequest: recording.snapshot_request(
            "id", pre_s=0, post_s=2, label="label", preset="preset"
        ),
        recording_pb2.ListRecordingsRequest: recording.list_request(7, "token"),
        recording_pb2.GetRecordingRequest: recording.get_request("recording", "token"),
        recording_pb2.GetRecordingThumbnailRequest: recording.thumbnail_request("recording"),
        recording_pb2.ExportRecordingRequest: recording.export_request(
            "recording", "file", offset=7, expected_sha256=b"sum", max_bytes_per_s=9
        ),
        recording_pb2.PinRecordingRequest: recording.pin_request("id", "recording", pinned=True),
        recording_pb2.UploadRecordingRequest: recording.upload_request("id", "recording"),
        recording_pb2.CancelUploadRequest: recording.cancel_upload_request("id", "recording"),
        recording_pb2.DeleteRecordingRequest: recording.delete_request(
            "id", "recording", expected_sha256=b"sum", force=True
        ),
    }
    for kind, data in requests.items():
        request = kind.FromString(data)
        assert {field.name for field, _ in request.ListFields()} == set(kind.DESCRIPTOR.fields_by_name)
    started = recording_pb2.StartRecordingRequest.FromString(recording.start_request("id"))
    assert not started.HasField("with_video")


def test_every_kind_of_event_has_a_word() -> None:
    payloads = event_pb2.Event.DESCRIPTOR.oneofs_by_name["payload"].fields
    kinds = {decoded_event(event_with(field.name)).kind for field in payloads}
    assert kinds == set(EventKind) - {EventKind.UNKNOWN}
    assert len(kinds) == len(payloads)
    without = event_pb2.Event(message="of a newer gateway")
    assert decoded_event(without).kind is EventKind.UNKNOWN


def event_with(payload: str) -> event_pb2.Event:
    event = event_pb2.Event()
    getattr(event, payload).SetInParent()
    return event


def decoded_event(event: event_pb2.Event) -> Event:
    response = robot_gateway_pb2.SubscribeEventsResponse(event=event)
    result = SUBSCRIBE_EVENTS.decode(response.SerializeToString())
    assert isinstance(result, Event)
    return result


def test_an_item_from_a_newer_gateway_is_none() -> None:
    assert SUBSCRIBE_EVENTS.decode(b"") is None


def test_every_message_of_the_contract_is_a_request_or_below_an_answer() -> None:
    """A message that no method carries would escape the tests above."""
    seen = {method.input_type.full_name for method in ANSWERS.values()}
    seen |= {method.output_type.full_name for method in ANSWERS.values()}
    seen |= {f"omniseer.gateway.v1.{name}" for name in ("DriveOpen", "DriveCommand")}  # in a DriveRequest
    seen |= answer_messages()
    declared = {m.full_name for file in FILES for m in file.DESCRIPTOR.message_types_by_name.values()}
    assert seen == declared


def test_every_method_of_the_contract_is_known() -> None:
    assert sorted(DECODERS) == sorted(ANSWERS)
    assert {method.path for method in ALL_METHODS} == {
        f"/{method.containing_service.full_name}/{method.name}" for method in ANSWERS.values()
    }


def declared_enums() -> list[EnumDescriptor]:
    return [enum for file in FILES for enum in file.DESCRIPTOR.enum_types_by_name.values()]


@pytest.mark.parametrize("enum", declared_enums(), ids=lambda enum: enum.name)
def test_every_enum_value_has_its_own_word(enum: EnumDescriptor) -> None:
    mapped = [ENUM_MAPPINGS[enum.name](value.number) for value in enum.values]
    assert len(set(mapped)) == len(mapped)
    assert set(mapped) == set(type(mapped[0])), "a word that has no number"
    for value, word in zip(enum.values, mapped, strict=True):
        own = "UNSPECIFIED" if word.name == "UNKNOWN" else word.name
        assert value.name.endswith(f"_{own}"), f"{value.name} reads {word}"


@pytest.mark.parametrize("name", ENUM_MAPPINGS)
def test_a_number_from_a_newer_gateway_reads_unknown(name: str) -> None:
    assert ENUM_MAPPINGS[name](999).value == "unknown"


def test_every_profile_can_be_asked_for() -> None:
    wire = preview_pb2.PreviewProfile.DESCRIPTOR
    numbers = {profile: enums.number(profile, wire) for profile in PreviewProfile}
    assert {number: enums.member(PreviewProfile, wire, number) for number in numbers.values()} == {
        number: profile for profile, number in numbers.items()
    }
