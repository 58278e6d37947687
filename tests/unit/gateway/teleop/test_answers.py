"""What operators are answered while the robot is stopped: how the stop ends, as a command to type."""

from typing import Any

import pytest

from common.broadcast import Broadcast
from gateway.links.drive.state import DriveSpec
from gateway.links.reconciler import Desired
from gateway.status.event import ControlAction
from gateway.status.preview import PreviewView
from gateway.status.teleop import DrivePhase, DriveView, StopLatch
from gateway.status.values import Velocity
from gateway.teleop.episodes import Episodes
from gateway.teleop.lease import Driver
from gateway.teleop.single_commands import SingleCommands
from gateway.teleop.teleop import Teleop
from tests.support.drive_views import actual

STOP = StopLatch(stop_id=221, by="anna", reason="lunch", since_ns=1)
RESET = "the robot is stopped by anna until you type: robotctl reset-stop 221"


class Drive:
    """A drive program that is stopped, and applies and takes everything at once."""

    def __init__(self) -> None:
        self.changes = Broadcast()
        self.connection = 1
        self.desired = Desired(1, DriveSpec(enabled=True))
        self.taken: list[object] = []

    @property
    def view(self) -> DriveView:
        state = actual(phase=DrivePhase.STOPPED, stop=STOP, applied_revision=self.desired.revision)
        return DriveView(enabled=self.desired.spec.enabled, applied=True, error="", actual=state)

    def request(self, spec: DriveSpec) -> Desired[DriveSpec]:
        self.desired = Desired(self.desired.revision + 1, spec)
        return self.desired

    async def wait_until_settled(self, _desired: Desired[DriveSpec], _within_s: float) -> bool:
        return True

    def grant(self, *_: object, **__: object) -> bool:
        return True

    def command(self, _session_id: str, command: object) -> bool:
        self.taken.append(command)
        return True


class Sink:
    def record_action(self, action: ControlAction) -> None:
        raise AssertionError(action)


class Preview:
    @property
    def view(self) -> PreviewView:
        raise AssertionError("it is reported while the gateway runs")


def teleop(drive: Any) -> Teleop:
    return Teleop(drive, drive, Preview(), line_of_sight=True, episodes=Episodes(Sink()))


@pytest.mark.parametrize("enabled", [True, False])
async def test_who_enables_or_disables_driving_learns_how_the_stop_ends(enabled: bool) -> None:
    accepted, message = await teleop(Drive()).set_enabled(enabled=enabled)
    assert accepted
    assert message == f"driving is {'enabled' if enabled else 'disabled'}; {RESET}"


async def test_who_sends_a_single_command_learns_how_the_stop_ends() -> None:
    drive = Drive()
    single = SingleCommands(teleop(drive), permitted=True)
    answer = single.command(Driver("ben", "ben", "10.0.0.9:4711"), Velocity(0.1, 0.0, 0.0))
    assert answer == (True, RESET)
    assert len(drive.taken) == 1
