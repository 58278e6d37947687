"""Every field of every message of the contract reaches a result: changing it changes what the client sees."""

from collections.abc import Iterator
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor, EnumDescriptor, FieldDescriptor

from console.client.mapping import enums
from console.client.mapping.methods import (
    METHODS,
    SET_PREVIEW_MODE,
    STREAMS,
    SUBSCRIBE_EVENTS,
    WATCH_SYSTEM_STATUS,
    EventsWanted,
    PreviewWish,
)
from console.client.results import EventKind, EventPosition, FaultSeverity, PreviewProfile
from omniseer.gateway.v1 import (
    event_pb2,
    fault_pb2,
    gateway_info_pb2,
    overlay_pb2,
    platform_pb2,
    preview_pb2,
    robot_gateway_pb2,
    source_pb2,
    states_pb2,
    system_status_pb2,
)
from tests.support.filled import fill, value_of

FILES = (
    event_pb2,
    source_pb2,
    fault_pb2,
    gateway_info_pb2,
    overlay_pb2,
    platform_pb2,
    preview_pb2,
    robot_gateway_pb2,
    states_pb2,
    system_status_pb2,
)
SERVICE = robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"]
DECODERS = {method.name: method.decode for method in (*METHODS, *STREAMS)}

ENUM_MAPPINGS = {
    "ControlResult": enums.control_result,
    "EventGapReason": enums.gap_reason,
    "PreviewState": enums.preview_state,
    "SourceState": enums.source_state,
    "FaultSeverity": enums.fault_severity,
    "RobotHealthState": enums.health_state,
    "TeleopState": enums.teleop_state,
    "PreviewProfile": enums.preview_profile,
    "VideoCodec": enums.video_codec,
    "StreamTransport": enums.stream_transport,
    "StreamContainer": enums.stream_container,
}

LEFT_OUT: dict[str, str] = {}
"""Fields on purpose without a place in the results: full name -> reason. None today."""

Path = tuple[FieldDescriptor, ...]


def paths(message: Descriptor, above: Path = ()) -> Iterator[Path]:
    """All ways from a message down to a value."""
    for field in message.fields:
        if field.message_type:
            yield from paths(field.message_type, (*above, field))
        else:
            yield (*above, field)


def change(message: Any, path: Path) -> None:
    """Gives the value at the end of the path its other value."""
    for field in path[:-1]:
        inner = getattr(message, field.name)
        message = inner[0] if field.is_repeated else inner
    setattr(message, path[-1].name, value_of(path[-1], first=False))


ANSWER_PATHS = [(method.name, path) for method in SERVICE.methods for path in paths(method.output_type)]


@pytest.mark.parametrize(
    ("method", "path"),
    [
        pytest.param(name, path, id=f"{name}:{'.'.join(field.name for field in path)}")
        for name, path in ANSWER_PATHS
    ],
)
def test_every_field_of_an_answer_reaches_the_result(method: str, path: Path) -> None:
    if path[-1].full_name in LEFT_OUT:
        pytest.skip(LEFT_OUT[path[-1].full_name])
    answer_type = SERVICE.methods_by_name[method].output_type._concrete_class
    answer = answer_type()
    fill(answer)
    before = DECODERS[method](answer.SerializeToString())
    change(answer, path)
    assert DECODERS[method](answer.SerializeToString()) != before


def test_every_field_of_a_request_is_set_from_a_wish() -> None:
    request = robot_gateway_pb2.SetPreviewModeRequest.FromString(
        SET_PREVIEW_MODE.encode(PreviewWish(True, PreviewProfile.HIGH_QUALITY))
    )
    assert request.enabled
    assert request.profile == preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_every_field_of_a_subscription_is_set() -> None:
    request = robot_gateway_pb2.SubscribeEventsRequest.FromString(
        SUBSCRIBE_EVENTS.encode(EventsWanted(EventPosition("run", 7), FaultSeverity.ERROR))
    )
    assert (request.after.run_id, request.after.sequence) == ("run", 7)
    assert request.min_severity == fault_pb2.FAULT_SEVERITY_ERROR
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_the_interval_of_a_watch_is_told_in_ms() -> None:
    request = robot_gateway_pb2.WatchSystemStatusRequest.FromString(WATCH_SYSTEM_STATUS.encode(0.25))
    assert request.min_interval_ms == 250
    assert {field.name for field, _ in request.ListFields()} == set(request.DESCRIPTOR.fields_by_name)


def test_every_kind_of_event_has_a_word() -> None:
    payloads = event_pb2.Event.DESCRIPTOR.oneofs_by_name["payload"].fields
    kinds = {SUBSCRIBE_EVENTS.decode(_event_with(field.name)).kind for field in payloads}
    assert kinds == set(EventKind) - {EventKind.UNKNOWN}
    assert len(kinds) == len(payloads)
    without = robot_gateway_pb2.SubscribeEventsResponse(event=event_pb2.Event(message="of a newer gateway"))
    assert SUBSCRIBE_EVENTS.decode(without.SerializeToString()).kind is EventKind.UNKNOWN


def _event_with(payload: str) -> bytes:
    response = robot_gateway_pb2.SubscribeEventsResponse()
    getattr(response.event, payload).SetInParent()
    return response.SerializeToString()


def test_every_message_of_the_contract_is_a_request_or_below_an_answer() -> None:
    """A message that no method carries would escape the tests above."""
    seen = {method.input_type.full_name for method in SERVICE.methods}
    seen |= {method.output_type.full_name for method in SERVICE.methods}
    seen |= {field.containing_type.full_name for _, path in ANSWER_PATHS for field in path}
    declared = {m.full_name for file in FILES for m in file.DESCRIPTOR.message_types_by_name.values()}
    assert seen == declared


def test_every_method_of_the_contract_is_known() -> None:
    assert sorted(DECODERS) == sorted(SERVICE.methods_by_name)
    assert {method.path for method in (*METHODS, *STREAMS)} == {
        f"/omniseer.gateway.v1.RobotGateway/{method.name}" for method in SERVICE.methods
    }


def declared_enums() -> list[EnumDescriptor]:
    return [enum for file in FILES for enum in file.DESCRIPTOR.enum_types_by_name.values()]


@pytest.mark.parametrize("enum", declared_enums(), ids=lambda enum: enum.name)
def test_every_enum_value_has_its_own_word(enum: EnumDescriptor) -> None:
    mapped = [ENUM_MAPPINGS[enum.name](value.number) for value in enum.values]
    assert len(set(mapped)) == len(mapped)
    assert set(mapped) == set(type(mapped[0])), "a word that no gateway can say"


@pytest.mark.parametrize("name", ENUM_MAPPINGS)
def test_a_number_from_a_newer_gateway_reads_unknown(name: str) -> None:
    assert ENUM_MAPPINGS[name](999).value == "unknown"


def test_every_profile_can_be_asked_for() -> None:
    numbers = {profile: enums.profile_number(profile) for profile in PreviewProfile}
    assert {number: enums.preview_profile(number) for number in numbers.values()} == {
        number: profile for profile, number in numbers.items()
    }
