"""What a client sees where the robot knows nothing, and numbers as they were meant."""

import math

import pytest

from console.client.mapping.methods import GET_OVERLAY_SNAPSHOT, GET_SYSTEM_STATUS
from console.client.mapping.reader import number
from console.client.results import Freshness, PreviewProfile, PreviewState, SystemStatus
from omniseer.gateway.v1 import overlay_pb2, system_status_pb2


def decoded(message: system_status_pb2.SystemStatus) -> SystemStatus:
    return GET_SYSTEM_STATUS.decode(message.SerializeToString())


def test_an_empty_answer_knows_nothing_and_invents_nothing() -> None:
    status = GET_SYSTEM_STATUS.decode(b"")
    for part in (status.odometry, status.vision, status.effective_command, status.platform.compute):
        assert part.freshness is Freshness.MISSING
        assert part.age_ms is None
    assert status.odometry.vx_mps is None
    assert status.vision.infer_error_count is None
    assert status.preview.state is PreviewState.UNKNOWN
    assert status.preview.profile is PreviewProfile.UNKNOWN
    assert status.preview.endpoint is None
    assert status.preview.encoder is None
    assert status.preview.video is None
    assert status.preview.measured.worst_rtt_ms is None


def test_a_value_that_is_not_available_is_none_even_when_a_number_was_sent() -> None:
    message = system_status_pb2.SystemStatus()
    message.platform.compute.available = True
    message.platform.compute.cpu_temperature_c = 55
    assert decoded(message).platform.compute.cpu_temperature_c is None
    message.platform.compute.cpu_temperature_available = True
    assert decoded(message).platform.compute.cpu_temperature_c == 55


def test_zero_is_not_unknown() -> None:
    message = system_status_pb2.SystemStatus()
    message.health.odom_available = True
    message.preview.measured.available = True
    message.preview.measured.worst_rtt_ms = 0
    status = decoded(message)
    assert status.odometry.vx_mps == 0
    assert status.odometry.age_ms == 0
    assert status.preview.measured.worst_rtt_ms == 0
    assert status.preview.measured.worst_loss_percent is None


def test_freshness_is_one_word() -> None:
    message = system_status_pb2.SystemStatus()
    message.vision.available = True
    assert decoded(message).vision.freshness is Freshness.FRESH
    message.vision.stale = True
    assert decoded(message).vision.freshness is Freshness.STALE


def test_a_field_from_a_newer_gateway_is_passed_over() -> None:
    unknown_field = bytes([0xFA, 0x06, 0x02]) + b"hi"  # number 111, a string
    message = system_status_pb2.SystemStatus(gateway_name="lab-1")
    status = GET_SYSTEM_STATUS.decode(message.SerializeToString() + unknown_field)
    assert status.gateway_name == "lab-1"


def test_floats_keep_the_digits_they_have() -> None:
    message = system_status_pb2.SystemStatus()
    message.health.odom_available = True
    message.health.measured_vx_mps = 0.1
    assert message.health.measured_vx_mps != 0.1, "the wire rounds"
    assert decoded(message).odometry.vx_mps == 0.1
    assert number(16777215.0) == 16777220.0  # seven digits, no more


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_not_known(value: float) -> None:
    message = system_status_pb2.SystemStatus()
    message.health.odom_available = True
    message.health.measured_vx_mps = value
    assert decoded(message).odometry.vx_mps is None


def test_the_order_of_detections_and_events_is_kept() -> None:
    message = overlay_pb2.OverlaySnapshot()
    message.detections.available = True
    for class_id in (3, 1, 2):
        message.detections.detections.add(class_id=class_id)
        message.events.add(sequence=class_id)
    snapshot = GET_OVERLAY_SNAPSHOT.decode(message.SerializeToString())
    assert [item.class_id for item in snapshot.detections.items] == [3, 1, 2]
    assert [event.sequence for event in snapshot.events] == [3, 1, 2]


def test_the_passphrase_shows_in_no_print() -> None:
    message = system_status_pb2.SystemStatus()
    message.preview.endpoint.passphrase = "correct horse battery"
    status = decoded(message)
    assert status.preview.endpoint is not None
    assert status.preview.endpoint.passphrase == "correct horse battery"
    assert "correct horse" not in repr(status)
