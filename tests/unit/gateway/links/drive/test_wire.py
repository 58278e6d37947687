"""The mapping of the drive program's messages is total, and both ends agree on them."""

from dataclasses import fields

import pytest

from drive.endpoint.wire import event_of
from drive.motion.values import Inhibit
from drive.motion.values import LeaseEnd as DriveLeaseEnd
from gateway.links.drive import wire
from gateway.links.drive.commands import ENDS
from gateway.links.drive.state import DriveCommand
from gateway.links.watch import LinkLostError
from gateway.status.teleop import (
    FOUND_BY_THE_GATEWAY,
    DriveActual,
    DriveCounters,
    DriveEpisode,
    DriveInhibit,
    DriveLimits,
    DrivePhase,
    LeaseEnd,
    StopLatch,
)
from gateway.status.values import Velocity
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.filled import fill_distinctly


def test_every_phase_and_every_inhibit_has_its_member() -> None:
    assert set(wire.PHASES) == set(pb.Phase.values()) - {pb.PHASE_UNSPECIFIED}
    assert set(wire.PHASES.values()) == set(DrivePhase)
    assert set(wire.INHIBITS) == set(pb.Inhibit.values()) - {pb.INHIBIT_UNSPECIFIED}
    assert set(wire.INHIBITS.values()) == set(DriveInhibit) - FOUND_BY_THE_GATEWAY
    assert {each.name for each in Inhibit} == {each.name for each in wire.INHIBITS.values()}


def test_every_end_of_a_lease_has_its_number() -> None:
    assert set(ENDS) == set(LeaseEnd)
    assert set(ENDS.values()) == set(pb.LeaseEnd.values()) - {pb.LEASE_END_UNSPECIFIED}
    assert {each.name for each in DriveLeaseEnd} <= {each.name for each in LeaseEnd}


def test_every_field_of_a_report_arrives() -> None:
    welcome, message = pb.Welcome(), pb.ActualState()
    fill_distinctly(welcome)
    fill_distinctly(message)
    report = wire.report_from(welcome, message)
    assert (report.instance_id, report.monotonic_ns) == (welcome.instance_id, message.monotonic_ns)
    assert report.velocity == Velocity(message.vx_mps, message.vy_mps, message.wz_rad_s)
    assert report.problems == tuple(message.problems)
    assert report.base_timeout_ms == welcome.base_timeout_ms
    assert wire.report_from(pb.Welcome(), message).base_timeout_ms is None
    assert report.enabled is True
    assert report.turn_limit_rad_s == message.turn_limit_rad_s
    for name in ("enabled", "turn_limit_rad_s"):
        message.ClearField(name)
        assert getattr(wire.report_from(pb.Welcome(), message), name) is None
    parts = (
        (report.limits, welcome.limits, DriveLimits),
        (report.stop, message.stop, StopLatch),
        (report.counters, message.counters, DriveCounters),
        (report.episode, message.episode, DriveEpisode),
    )
    for part, source, kind in parts:
        assert {field.name for field in fields(kind)} == set(source.DESCRIPTOR.fields_by_name)
        assert part == kind(**{field.name: getattr(source, field.name) for field in fields(kind)})
    own = {"instance_id", "velocity", "limits", "base_timeout_ms"}
    # What only heartbeats to the guard have is no part of a report.
    of_the_guard = {"matched", "lock_left"}
    sent = set(message.DESCRIPTOR.fields_by_name) - {"vx_mps", "vy_mps", "wz_rad_s"} - of_the_guard
    # The gateway knows its own commands.
    assert {field.name for field in fields(DriveActual)} - own == sent - {"newest_sequence", "command_ns"}


def test_an_unknown_phase_is_of_another_version() -> None:
    with pytest.raises(LinkLostError, match="version"):
        wire.report_from(pb.Welcome(), pb.ActualState(phase=99))  # type: ignore[arg-type]


def test_the_drive_program_reads_the_commands_as_they_were_meant() -> None:
    command = DriveCommand(7, True, Velocity(0.25, -0.5, 0.75), 10, 8, 9)
    read = event_of(wire.command_message("session", command))
    assert read is not None
    assert {name: getattr(read, name) for name in ("session_id", "sequence", "held", "echo_ns")} == {
        "session_id": "session",
        "sequence": 7,
        "held": True,
        "echo_ns": 8,
    }
    velocity, valid_until_ns, picture_ns = (
        getattr(read, name) for name in ("velocity", "valid_until_ns", "picture_ns")
    )
    assert (velocity.vx_mps, velocity.vy_mps, velocity.wz_rad_s) == (0.25, -0.5, 0.75)
    assert (valid_until_ns, picture_ns) == (10, 9)
