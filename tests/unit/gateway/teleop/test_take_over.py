"""What the drive program is sent when a driver takes over from another."""

from typing import Any

import pytest

from common.broadcast import Broadcast
from gateway.links.drive.commands import DriveCommands
from gateway.status.event import ControlAction
from gateway.status.preview import PreviewView
from gateway.status.teleop import DriveInhibit, DrivePhase, DriveView, LeaseEnd, StopLatch
from gateway.teleop.episodes import Episodes
from gateway.teleop.lease import Driver
from gateway.teleop.teleop import Teleop
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.drive_views import actual

ANNA, ADMIN = Driver("anna", "anna", "10.0.0.9:4711"), Driver("carla", "carla", "10.0.0.8:4711", admin=True)


class Connection:
    """Takes leases, as the drive program does."""

    def __init__(self) -> None:
        self.lease = ""

    def send(self, message: pb.ToDrive) -> bool:
        if message.HasField("grant"):
            self.lease = message.grant.session_id
        elif message.HasField("end") and message.end.session_id == self.lease:
            self.lease = ""
        return True


class Link:
    """To a drive program whose desired state is applied, or on its way."""

    def __init__(self) -> None:
        self.changes = Broadcast()
        self.applied = True
        self.actual = actual()

    @property
    def view(self) -> DriveView:
        return DriveView(enabled=True, applied=self.applied, error="", actual=self.actual)


class Never:
    """What no test here comes to."""

    @property
    def view(self) -> PreviewView:
        raise AssertionError

    def record_action(self, action: ControlAction) -> None:
        raise AssertionError(action)


def teleop_with(link: Link, connection: Connection) -> Teleop:
    commands, port = DriveCommands(Never()), Never()  # type: ignore[arg-type]
    commands._client = connection  # type: ignore[assignment]
    drive: Any = link
    return Teleop(drive, commands, port, line_of_sight=True, episodes=Episodes(port))


@pytest.mark.parametrize("applied", [True, False])
def test_no_lease_is_left_of_a_driver_who_was_taken_over_from(applied: bool) -> None:
    """The new one can't be granted while the desired state is on its way, and may end before it is."""
    link, connection = Link(), Connection()
    teleop = teleop_with(link, connection)
    first = teleop.open_lane(ANNA, take_over=False, line_of_sight=True)
    assert connection.lease == first.session_id
    link.applied = applied
    second = teleop.open_lane(ADMIN, take_over=True, line_of_sight=True)
    assert connection.lease == (second if applied else first).session_id, "it keeps autonomy away"
    second.close(LeaseEnd.CLOSED)
    assert connection.lease == ""


def test_the_first_of_several_drivers_keeps_it_until_the_last_is_granted_the_lease() -> None:
    link, connection = Link(), Connection()
    teleop = teleop_with(link, connection)
    first = teleop.open_lane(ANNA, take_over=False, line_of_sight=True)
    link.applied = False
    teleop.open_lane(ADMIN, take_over=True, line_of_sight=True)
    last = teleop.open_lane(ADMIN, take_over=True, line_of_sight=True)
    assert connection.lease == first.session_id
    link.applied = True
    teleop._grant()
    assert connection.lease == last.session_id
    last.close(LeaseEnd.CLOSED)
    assert connection.lease == ""


def taken_over(*, applied: bool, **reported: Any) -> tuple[DrivePhase, tuple[DriveInhibit, ...]]:
    """What the driver is sent who has taken over, while the drive program still reports the other's lease."""
    link = Link()
    teleop = teleop_with(link, Connection())
    first = teleop.open_lane(ANNA, take_over=False, line_of_sight=True)
    link.actual = actual(session_id=first.session_id, **reported)
    link.applied = applied
    facts = teleop.open_lane(ADMIN, take_over=True, line_of_sight=True).facts()
    return facts.phase, facts.inhibits


@pytest.mark.parametrize("applied", [True, False], ids=["granted", "not granted yet"])
@pytest.mark.parametrize(
    "phase", [DrivePhase.ARMED, DrivePhase.DRIVING, DrivePhase.STOPPING, DrivePhase.INHIBITED]
)
def test_a_driver_is_sent_no_phase_of_the_lease_before(phase: DrivePhase, applied: bool) -> None:
    """The defect: "armed" of the other driver's lease, by which a client took a hold for one that moves."""
    assert taken_over(applied=applied, phase=phase) == (DrivePhase.INHIBITED, ())


@pytest.mark.parametrize("applied", [True, False], ids=["granted", "not granted yet"])
def test_the_reasons_of_the_driver_before_are_not_those_of_the_next(applied: bool) -> None:
    reasons = (DriveInhibit.PICTURE_STALE, DriveInhibit.COMMAND_LATE, DriveInhibit.ROBOT_STOP)
    phase, inhibits = taken_over(applied=applied, phase=DrivePhase.INHIBITED, inhibits=reasons)
    assert (phase, inhibits) == (DrivePhase.INHIBITED, (DriveInhibit.ROBOT_STOP,))


@pytest.mark.parametrize("applied", [True, False], ids=["granted", "not granted yet"])
def test_a_stop_is_every_drivers(applied: bool) -> None:
    stop = StopLatch(221, "anna", "lunch", 1)
    assert taken_over(applied=applied, phase=DrivePhase.STOPPED, stop=stop) == (DrivePhase.STOPPED, ())


def test_a_driver_is_sent_the_phase_of_the_own_lease() -> None:
    link = Link()
    teleop = teleop_with(link, Connection())
    lane = teleop.open_lane(ANNA, take_over=False, line_of_sight=True)
    late = (DriveInhibit.COMMAND_LATE,)
    link.actual = actual(session_id=lane.session_id, phase=DrivePhase.INHIBITED, inhibits=late)
    assert (lane.facts().phase, lane.facts().inhibits) == (DrivePhase.INHIBITED, late)
    link.actual = actual(session_id=lane.session_id, phase=DrivePhase.DRIVING)
    assert lane.facts().phase is DrivePhase.DRIVING
