"""The mapping is total: every state has a value, every field of the contract is set by some snapshot."""

from collections.abc import Iterator
from dataclasses import replace
from enum import Enum
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from common.errors import InvalidRequestError
from gateway.access.role import Role
from gateway.rpc.calls.methods import SERVICES, Method
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.interceptors.stats import MethodStats
from gateway.rpc.mapping import enums
from gateway.rpc.mapping.info import gateway_info
from gateway.rpc.mapping.status import overlay_snapshot, system_status
from gateway.rpc.server import SERVICE, Services
from gateway.status.board import Board
from gateway.status.cloud import CloudState, RecordingCopyState
from gateway.status.event_log import OperatorEvent
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.health import HealthState
from gateway.status.limit import Limit
from gateway.status.meaning import NumberMeaning, TextMeaning
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
from gateway.status.recording import (
    RecorderState,
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
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
from gateway.status.source_view import SourceState
from gateway.status.sources import (
    BATTERY,
    COMPUTE,
    DETECTIONS,
    DIAGNOSTICS,
    EFFECTIVE_COMMAND,
    MODE,
    NETWORK,
    ODOMETRY,
    ONBOARD_BATTERY,
    ORIENTATION,
    POSITION,
    ROS_SOURCES,
    VISION,
    number_source,
    text_source,
)
from gateway.status.teleop import DriveInhibit, DrivePhase
from gateway.status.values import (
    Battery,
    Compute,
    Detection,
    Detections,
    Diagnostics,
    Fix,
    Mode,
    Network,
    Number,
    Orientation,
    Position,
    Received,
    Text,
    Velocity,
    Vision,
)
from omniseer.gateway.v1 import (
    cloud_pb2,
    event_pb2,
    fault_pb2,
    overlay_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    robot_gateway_pb2,
    source_pb2,
    states_pb2,
    teleop_pb2,
)
from tests.support.cloud_views import uploading_view
from tests.support.drive_views import stopped_view
from tests.support.recorder_views import recording_view

FRESH = SourceRule(10**9, required=True)
NOW_S = 1000.0
CALLER = Recipient(robot_host="10.1.2.3", sees_passphrase=True)
FAULT = Condition("odometry.stale", Severity.ERROR, "odometry", "it stopped", "look at it")


@pytest.mark.parametrize(
    ("domain", "table", "wire_enum"),
    [
        (PreviewState, enums.PREVIEW_STATES, states_pb2.PreviewState),
        (Profile, enums.PROFILES, preview_pb2.PreviewProfile),
        (Codec, enums.CODECS, preview_pb2.VideoCodec),
        (Fix, enums.FIXES, pose_pb2.FixStatus),
        (SourceState, enums.SOURCE_STATES, source_pb2.SourceState),
        (Severity, enums.SEVERITIES, fault_pb2.FaultSeverity),
        (HealthState, enums.HEALTH_STATES, states_pb2.RobotHealthState),
        (DrivePhase, enums.DRIVE_PHASES, teleop_pb2.DrivePhase),
        (DriveInhibit, enums.DRIVE_INHIBITS, teleop_pb2.DriveInhibit),
        (RecorderState, enums.RECORDER_STATES, recording_pb2.RecorderState),
        (RecordingKind, enums.RECORDING_KINDS, recording_pb2.RecordingKind),
        (RecordingState, enums.RECORDING_STATES, recording_pb2.RecordingState),
        (RecordingStopReason, enums.RECORDING_STOP_REASONS, recording_pb2.RecordingStopReason),
        (RecordingChange, enums.RECORDING_CHANGES, event_pb2.RecordingChange),
        (CloudState, enums.CLOUD_STATES, cloud_pb2.CloudState),
        (RecordingCopyState, enums.COPY_STATES, recording_pb2.RecordingCopyState),
    ],
)
def test_an_enum_and_its_counterpart_cover_each_other(domain: type[Enum], table: Any, wire_enum: Any) -> None:
    assert set(domain) <= set(table) <= {None, *domain}
    assert len(set(table.values())) == len(table)
    assert {0, *table.values()} == set(wire_enum.values())


def test_a_profile_outside_the_enum_is_an_invalid_request() -> None:
    for number in (-1, 4, 2**31 - 1):
        with pytest.raises(InvalidRequestError, match=str(number)):
            enums.profile_from(number)
    assert enums.profile_from(0) is None


def test_every_method_of_the_contract_has_a_handler() -> None:
    assert SERVICES[0].full_name == SERVICE
    anything: Any = _AnyService()
    methods = Services(*[anything] * 6).methods()
    names = [method.name for service in SERVICES for method in service.methods]
    assert set(methods) == set(names)
    assert len(methods) == len(names), "statistics know methods by their names"


def test_the_control_actions_are_these_and_a_viewer_may_only_stop() -> None:
    methods = [Method(f"/{each.full_name}/{name}") for each in SERVICES for name in each.methods_by_name]
    changing = {method.name: method.needed for method in methods if method.changes_robot}
    assert changing.pop("StopRobot") is Role.VIEWER
    assert changing == dict.fromkeys(
        (
            "SetPreviewMode",
            "SetTeleopEnabled",
            "SendTeleopCommand",
            "Drive",
            "ResetStop",
            "StartRecording",
            "StopRecording",
            "TriggerSnapshot",
            "PinRecording",
            "DeleteRecording",
            "UploadRecording",
            "CancelUpload",
        ),
        Role.OPERATOR,
    )


def test_no_limit_applies_to_the_stop_alone() -> None:
    methods = [Method(f"/{each.full_name}/{name}") for each in SERVICES for name in each.methods_by_name]
    assert [method.name for method in methods if method.unlimited] == ["StopRobot"]
    assert not Method("/other.Service/StopRobot").unlimited


class _AnyService:
    """Has every method."""

    def __getattr__(self, name: str) -> Any:
        return name


STALE = SourceRule(1000, required=False)
CELL = number_source(
    "cell",
    "Cell 3",
    NumberMeaning("V", 2, Limit(3.3, 3.4), Limit(3.0, 3.1), Limit(4.1, 4.0), Limit(4.3, 4.2), tile=True),
)


GRIPPER = text_source("gripper", "Gripper", TextMeaning(tile=True))


def everything() -> Snapshot:
    """Every value known, none of them zero, all of them stale by a known age."""
    at_s = NOW_S - 10
    preview = PreviewView(
        state=PreviewState.RUNNING,
        profile=Profile.LOW_BW,
        last_error="what went wrong",
        service_reachable=True,
        listener=Listener(7100, 125, "127.0.0.1", -36),
        stream=Stream(1280, 720, 15.0, 1000, Codec.H265, True, "RTT 180 ms"),
        encoder=Encoder("x264", True, "mpp-h265", "no such element"),
        measured=Received(Measurement(14.5, 990.0, 2, 12, 180.0, 6.0), at_s),
        counters=Counters(4, 3, 2, 1, 6),
        passphrase="a-passphrase",
        wanted_camera="front",
        cameras=(
            Camera("front", CameraState.FAILED, "unplugged", "rear"),
            Camera("rear", CameraState.LIVE),
        ),
    )
    board = Board(
        {
            ODOMETRY: Received(Velocity(0.3, 0.4, -0.5), at_s),
            VISION: Received(Vision(30.0, 29.0, 11.0, 7, 1), at_s),
            DETECTIONS: Received(
                Detections(1280, 720, 3, (Detection(5, "person", 0.5, "t1", 1.0, 2.0, 3.0, 4.0),)), at_s
            ),
            BATTERY: Received(Battery(True, 15.0, 80.0, True), at_s),
            MODE: Received(Mode("exploring"), at_s),
            EFFECTIVE_COMMAND: Received(Velocity(0.25, -0.5, 0.75), at_s),
            COMPUTE: Received(Compute(40.0, 60.0, True, 1, 2, 50.0), at_s),
            NETWORK: Received(Network("wlan0", True, -60, 70), at_s),
            DIAGNOSTICS: Received(Diagnostics(()), at_s),
            ONBOARD_BATTERY: Received(Battery(True, 12.0, 70.0, True), at_s),
            CELL: Received(Number(3.25), at_s),
            POSITION: Received(Position(Fix.SBAS, 48.5, 11.5, 520.0, 1.5, 2.5), at_s),
            ORIENTATION: Received(Orientation(1.5, -2.5, 90.5), at_s),
            GRIPPER: Received(Text("open"), at_s),
        }
    )
    setup = Setup(
        Identity("lab", "1.2.3", insecure=True),
        # All of them are stale but the one that is required.
        Rules(
            {spec: SourceRule(1000, required=False) for spec in ROS_SOURCES}
            | {DIAGNOSTICS: FRESH, CELL: STALE, GRIPPER: STALE},
            3000,
        ),
    )
    programs = Programs(preview, stopped_view(NOW_S), recording_view(at_s), uploading_view(at_s))
    noted = Noted(
        events=(OperatorEvent(1, at_s, "something happened"),),
        faults=(Fault(FAULT, at_s - 1, at_s, None, 1), Fault(FAULT, at_s - 3, at_s - 1, at_s, 2)),
        gateway=Runtime("f" * 40, "boot", 1000, 3, 20, 2, "run"),
        pictures=Pictures(2, 140, 138, direct_count=1, srt_latency_count=1, most_given_up=4),
    )
    return take(setup, board, programs, NOW_S, noted)


def merged(items: Any) -> Any:
    """What any of the items has set."""
    if not isinstance(items[0], Message):
        return items[0]
    whole = type(items[0])()
    for item in items:
        whole.MergeFrom(item)
    return whole


def unset(message: Any, descriptor: Descriptor) -> Iterator[str]:
    for field in descriptor.fields:
        value = getattr(message, field.name)
        if field.is_repeated:
            if not value:
                yield field.full_name
                continue
            value = merged(value)
        if field.type == FieldDescriptor.TYPE_MESSAGE:
            if not field.is_repeated and not message.HasField(field.name):
                yield field.full_name
            assert field.message_type is not None
            yield from unset(value, field.message_type)
        elif not value:
            yield field.full_name


def test_a_full_snapshot_sets_every_field_of_the_contract() -> None:
    overlay = overlay_snapshot(everything(), CALLER)
    assert not list(unset(overlay, overlay_pb2.OverlaySnapshot.DESCRIPTOR))


def test_the_info_sets_every_field_of_its_answer() -> None:
    info = gateway_info(everything(), {"GetSystemStatus": MethodStats(3, 2, 1)}, 1_700_000_000_000, "{}")
    assert not list(unset(info, robot_gateway_pb2.GetGatewayInfoResponse.DESCRIPTOR))


def test_the_values_arrive_where_the_contract_has_them() -> None:
    status = overlay_snapshot(everything(), CALLER).status
    assert status.health.linear_speed_mps == pytest.approx(0.5)
    assert status.health.angular_speed_rad_s == pytest.approx(0.5)
    assert status.health.measured_wz_rad_s == pytest.approx(-0.5)
    assert (status.health.odom_age_ms, status.health.odom_stale) == (10_000, True)
    command = status.effective_command
    assert (command.vx_mps, command.vy_mps, command.wz_rad_s) == (0.25, -0.5, 0.75)
    assert command.active_source == "unknown", "a stale command has no source"
    assert status.mission.mode == "exploring"
    assert status.platform.power.lipo_battery.voltage == 15.0
    assert status.platform.power.onboard_battery.voltage == 12.0
    assert status.preview.measured.last_frame_age_ms == 12 + 10_000
    assert status.preview.endpoint.uri == "srt://10.1.2.3:7100?mode=caller&latency=125"


def test_an_active_fault_has_no_end_and_one_that_is_over_has() -> None:
    active = replace(everything(), faults=(Fault(FAULT, NOW_S - 4, NOW_S, None, 1),))
    (message,) = system_status(active, CALLER).faults
    assert (message.active, message.age_ms, message.HasField("cleared_age_ms")) == (True, 4000, False)
    _, over = system_status(everything(), CALLER).faults
    assert (over.active, over.age_ms, over.cleared_age_ms) == (False, 13_000, 10_000)


def test_the_passphrase_goes_only_to_roles_that_may_see_it() -> None:
    stranger = Recipient(robot_host="fe80::1", sees_passphrase=False)
    overlay = overlay_snapshot(everything(), stranger)
    assert overlay.status.preview.endpoint.encrypted
    assert overlay.status.preview.endpoint.passphrase == ""
    assert overlay.status.preview.endpoint.uri.startswith("srt://[fe80::1]:7100?")
    assert b"a-passphrase" not in overlay.SerializeToString()


def test_an_empty_snapshot_claims_nothing() -> None:
    setup = Setup(
        Identity("lab", "1.2.3", insecure=False),
        Rules(dict.fromkeys(ROS_SOURCES, SourceRule(1000, required=True)), 3000),
    )
    off = PreviewView(PreviewState.DISABLED, None, "", False, None, None, None, None, Counters())
    nothing = take(setup, Board(), Programs(off), NOW_S)
    overlay = overlay_snapshot(nothing, CALLER)
    status = overlay.status
    assert status.health.summary == "waiting for odometry"
    assert not any(
        part.available
        for part in (
            overlay.detections,
            status.vision,
            status.platform.compute,
            status.platform.network,
            status.platform.power.lipo_battery,
            status.platform.power.onboard_battery,
            status.preview.measured,
            status.effective_command,
            status.mission,
        )
    )
    assert status.preview.profile == preview_pb2.PREVIEW_PROFILE_UNSPECIFIED
    assert not status.preview.HasField("endpoint")
