"""A rule of the contract, read from its schema: what was measured somewhere says how far it can be trusted.

Each field that holds a value stands in a message, or below one, that has the fields `available`, `stale` and
`age_ms` (or the three with a common prefix, `odom_stale` for example). What needs no age is listed here with
the reason; an author who adds a field decides which of the two it is.
"""

from collections.abc import Iterator

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool
from google.protobuf.descriptor import Descriptor, FieldDescriptor

from omniseer.gateway.v1 import overlay_pb2, recording_pb2, robot_gateway_pb2, teleop_pb2

PACKAGE = "omniseer.gateway.v1."
TRIPLES = [
    {f"{prefix}available", f"{prefix}stale", f"{prefix}age_ms"} for prefix in ("", "odom_", "last_command_")
]

_ITSELF = "the gateway's own, true at the moment of the answer"
_SERVICE = "reported by the preview service on every change; service_reachable says whether it still speaks"
_RECORDER = "reported by the recorder on every change; its state says whether it still answers"
_BRIDGE = "reported by the bridge on every change; its state says whether it still answers"
_EVENT = "of something that happened at an instant which is reported with it; it never grows old"
NEEDS_NO_AGE = {
    "SystemStatus.gateway_name": _ITSELF,
    "SystemStatus.gateway_version": _ITSELF,
    "SystemStatus.insecure": _ITSELF,
    "PreviewStatus": _SERVICE,
    "StreamEndpoint": _SERVICE,
    "EncoderStatus": _SERVICE,
    "VideoFormat": _SERVICE,
    "Camera": _SERVICE,
    "PreviewCounters": "counted by the gateway itself",
    "Fault": "a verdict of the gateway's own with an age, found again five times a second",
    "GatewayFacts": _ITSELF,
    "MethodCounts": _ITSELF,
    "GetGatewayInfoResponse": _ITSELF,
    "OperatorEvent": "an event of the gateway's own; it has an age and is never stale",
    "Event": _EVENT,
    "PreviewStateChanged": _EVENT,
    "EncoderFallback": _EVENT,
    "ClientJoined": _EVENT,
    "ClientLeft": _EVENT,
    "ControlAction": _EVENT,
    "RobotModeChanged": _EVENT,
    "EventGap": _EVENT,
    "EventPosition": _ITSELF,
    "PingResponse": _ITSELF,
    "WatchSystemStatusResponse.monotonic_ns": _ITSELF,
    "SetPreviewModeResponse.accepted": _ITSELF,
    "SetPreviewModeResponse.message": _ITSELF,
    "RequestKeyFrameResponse": _SERVICE,
    "SetTeleopEnabledResponse.accepted": _ITSELF,
    "SetTeleopEnabledResponse.message": _ITSELF,
    "SendTeleopCommandResponse.accepted": _ITSELF,
    "SendTeleopCommandResponse.message": _ITSELF,
    "StopLatch": "a state with an age, which holds until it is reset",
    "DriveOpened": _ITSELF,
    "DriveLimits": "the robot's configuration",
    "DriveState": "of the instant that comes with it; the ages in it are of what they are named after",
    "StopRobotResponse.message": _ITSELF,
    "ResetStopResponse": _ITSELF,
    "RecordingStatus": _RECORDER,
    "RecordingPreset": _RECORDER,
    "RecordingStateChanged": _EVENT,
    "Recording": _RECORDER,
    "RecordingCopy": _RECORDER,
    "RecordingGap": _RECORDER,
    "RecordingFile": _RECORDER,
    "CloudStatus": _BRIDGE,
    "CloudStateChanged": _EVENT,
    "RecordingCopyChanged": _EVENT,
    "UploadRecordingResponse.message": _ITSELF,
    "CancelUploadResponse": _ITSELF,
    "StartRecordingResponse.message": _ITSELF,
    "StopRecordingResponse.message": _ITSELF,
    "TriggerSnapshotResponse.message": _ITSELF,
    "PinRecordingResponse.message": _ITSELF,
    "DeleteRecordingResponse": _ITSELF,
    "ListRecordingsResponse.next_page_token": _ITSELF,
    "GetRecordingResponse.next_page_token": _ITSELF,
    "ExportHeader": "of a file that never changes",
    "ExportChunk": "of a file that never changes",
    "GetRecordingThumbnailResponse": "of an instant that comes with it",
}


def answers() -> list[Descriptor]:
    services = (
        robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"],
        teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"],
        recording_pb2.DESCRIPTOR.services_by_name["RecordingService"],
    )
    return [method.output_type for service in services for method in service.methods]


def has_freshness(message: Descriptor) -> bool:
    names = {field.name for field in message.fields}
    return any(triple <= names for triple in TRIPLES)


def values_without_freshness(message: Descriptor, *, covered: bool = False) -> Iterator[str]:
    """The full names, without the package, of values that nothing says the age of."""
    covered = covered or has_freshness(message)
    for field in message.fields:
        if field.type == FieldDescriptor.TYPE_MESSAGE:
            assert field.message_type is not None
            yield from values_without_freshness(field.message_type, covered=covered)
        elif not covered:
            yield field.full_name.removeprefix(PACKAGE)


def is_excused(name: str) -> bool:
    return name in NEEDS_NO_AGE or name.partition(".")[0] in NEEDS_NO_AGE


@pytest.mark.parametrize("message", answers(), ids=lambda message: message.name)
def test_every_value_has_its_age_or_a_reason_for_none(message: Descriptor) -> None:
    assert [name for name in values_without_freshness(message) if not is_excused(name)] == []


def test_no_excuse_outlives_its_field() -> None:
    needed = {name for message in answers() for name in values_without_freshness(message)}
    used = {
        excuse
        for excuse in NEEDS_NO_AGE
        for name in needed
        if name == excuse or name.startswith(f"{excuse}.")
    }
    assert used == set(NEEDS_NO_AGE)


def test_detections_are_covered_by_their_set() -> None:
    assert has_freshness(overlay_pb2.DetectionOverlayStatus.DESCRIPTOR)
    assert not has_freshness(overlay_pb2.OverlayDetection.DESCRIPTOR)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        (["range_m"], ["Sonar.range_m"]),
        (["range_m", "available", "stale"], ["Sonar.range_m", "Sonar.available", "Sonar.stale"]),
        (["range_m", "available", "stale", "age_ms"], []),
    ],
)
def test_the_rule_bites(fields: list[str], expected: list[str]) -> None:
    file = descriptor_pb2.FileDescriptorProto(name="sonar.proto", package=PACKAGE[:-1], syntax="proto3")
    message = file.message_type.add(name="Sonar")
    for number, name in enumerate(fields, start=1):
        message.field.add(
            name=name,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_UINT64,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    assert list(values_without_freshness(pool.FindMessageTypeByName(f"{PACKAGE}Sonar"))) == expected
