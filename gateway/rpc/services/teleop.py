"""Driving: lanes of drivers, stops, and the methods of older tools."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Any, Final

from common.errors import InvalidRequestError, PreconditionError
from common.reasons import Reason
from gateway.access.role import Role
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.mapping.enums import DRIVE_PHASES
from gateway.rpc.mapping.teleop import command_from, drive_state, opened, stop_latch, teleop_status
from gateway.status.teleop import LeaseEnd
from gateway.status.values import Velocity
from gateway.teleop.lane import DriveFacts, Lane
from gateway.teleop.lease import Driver
from gateway.teleop.single_commands import SingleCommands
from gateway.teleop.teleop import Teleop
from omniseer.gateway.v1.robot_gateway_pb2 import (
    SendTeleopCommandRequest,
    SendTeleopCommandResponse,
    SetTeleopEnabledRequest,
    SetTeleopEnabledResponse,
)
from omniseer.gateway.v1.system_status_pb2 import TeleopStatus
from omniseer.gateway.v1.teleop_pb2 import (
    SUPERVISION_LINE_OF_SIGHT,
    DriveOpen,
    DriveRequest,
    DriveResponse,
    ResetStopRequest,
    ResetStopResponse,
    StopRobotRequest,
    StopRobotResponse,
)

STATE_EVERY_S: Final = 0.05
"""States a second without a change: 20."""
_MAX_DEVICE: Final = 32


class TeleopService:
    """Handlers of driving.

    Args:
        teleop: None where the robot is not set up for driving.
        legacy_clients: whether commands without hold-to-run are permitted.
        state: names the run of the gateway.
    """

    def __init__(self, teleop: Teleop | None, state: SnapshotSource, *, legacy_clients: bool) -> None:
        self._teleop = teleop
        self._single = SingleCommands(teleop, permitted=legacy_clients) if teleop else None
        self._state = state

    async def drive(
        self, requests: AsyncIterator[DriveRequest], call: CallContext
    ) -> AsyncIterator[DriveResponse]:
        """Yields states while a reader of its own takes the commands: neither waits for the other."""
        teleop = self._configured()
        opening = await anext(requests, None)
        if opening is None or opening.WhichOneof("message") != "open":
            raise InvalidRequestError("the first request of a lane has to open it")
        lane = _open(teleop, opening.open, _driver(call))
        reader = asyncio.create_task(_read(requests, lane), name="drive lane")
        try:
            limits, run_id = teleop.limits, self._state.snapshot().gateway.run_id
            yield opened(lane.session_id, run_id, limits, line_of_sight=teleop.line_of_sight)
            while not reader.done():
                facts = lane.facts()
                yield drive_state(facts)
                await _next_state(teleop, lane, facts, reader)
            # Raises what is wrong with the commands; without that the driver has closed the lane.
            reader.result()
            lane.close(LeaseEnd.CLOSED)
        finally:
            reader.cancel()
            lane.close(_why(call))

    async def stop_robot(self, request: StopRobotRequest, call: CallContext) -> StopRobotResponse:
        """Returns when the drive program has confirmed the stop."""
        stops = self._configured().stops
        stop = await stops.stop(_driver(call).name, request.reason, request.request_id)
        message = f"the robot is stopped; to reset the stop: robotctl reset-stop {stop.stop_id}"
        if not stops.in_force(stop):
            message = f"this request has stopped the robot before; that stop ({stop.stop_id}) is reset"
        return StopRobotResponse(message=message, stop=stop_latch(stop, time.monotonic_ns()))

    async def reset_stop(self, request: ResetStopRequest, _call: CallContext) -> ResetStopResponse:
        """Returns when the drive program has confirmed the reset."""
        teleop = self._configured()
        message = await teleop.stops.reset(request.stop_id)
        return ResetStopResponse(message=message, phase=DRIVE_PHASES[teleop.link.view.phase])

    async def set_teleop_enabled(
        self, request: SetTeleopEnabledRequest, _call: CallContext
    ) -> SetTeleopEnabledResponse:
        """Returns when the drive program has the switch, or has not answered for a while."""
        accepted, message = await self._configured().set_enabled(enabled=request.enabled)
        return SetTeleopEnabledResponse(accepted=accepted, message=message, teleop=self._status())

    async def send_teleop_command(
        self, request: SendTeleopCommandRequest, call: CallContext
    ) -> SendTeleopCommandResponse:
        """Returns at once: the drive program follows the command, or not."""
        velocity = Velocity(request.linear_x_mps, request.linear_y_mps, request.angular_z_rad_s)
        if self._single is None:
            raise _not_configured()
        accepted, message = self._single.command(_driver(call), velocity)
        return SendTeleopCommandResponse(accepted=accepted, message=message, teleop=self._status())

    def _configured(self) -> Teleop:
        if self._teleop is None:
            raise _not_configured()
        return self._teleop

    def _status(self) -> TeleopStatus:
        return teleop_status(self._configured().view(), time.monotonic())


def _not_configured() -> PreconditionError:
    return PreconditionError(
        "this robot is not set up for driving: run robot-drive there, and name its socket as teleop.socket "
        "in the gateway's configuration",
        Reason.TELEOP_NOT_CONFIGURED,
    )


async def _read(requests: AsyncIterator[DriveRequest], lane: Lane) -> None:
    """Takes the commands of a lane to its end.

    Raises:
        DomainError: one is not what it must be.
    """
    async for request in requests:
        if request.WhichOneof("message") != "command":
            raise InvalidRequestError("after the first request of a lane, all are commands")
        command = request.command
        lane.take(command_from(command), _device(command.input_device))


async def _next_state(teleop: Teleop, lane: Lane, sent: DriveFacts, reader: "asyncio.Task[None]") -> None:
    """Waits until a state is due: on a change, and STATE_EVERY_S after the last."""
    before = _change_key(sent)
    changes = teleop.link.changes
    await changes.wait_until(lambda: reader.done() or _change_key(lane.facts()) != before, STATE_EVERY_S)


def _change_key(facts: DriveFacts) -> tuple[Any, ...]:
    return facts.phase, facts.inhibits, facts.drive.stop, facts.drive.reachable


def _open(teleop: Teleop, request: DriveOpen, driver: Driver) -> Lane:
    if request.session_id:
        return teleop.join_lane(driver, request.session_id)
    line_of_sight = request.supervision == SUPERVISION_LINE_OF_SIGHT
    return teleop.open_lane(driver, take_over=request.take_over, line_of_sight=line_of_sight)


def _driver(call: CallContext) -> Driver:
    """Returns the caller: by name, or by host where callers are not authenticated."""
    principal, peer = call.principal, call.peer
    if principal is None:
        return Driver(peer.host, peer.host, peer.address)
    return Driver(
        key=principal.name,
        name=principal.name,
        address=peer.address,
        role=principal.role.value,
        credential=principal.credential_ids[0],
        admin=principal.role is Role.ADMIN,
    )


def _why(call: CallContext) -> LeaseEnd:
    """Returns why a lane ends that its driver has not closed."""
    return LeaseEnd.ACCESS_ENDED if call.refusal else LeaseEnd.LOST


def _device(text: str) -> str:
    return "".join(letter for letter in text[:_MAX_DEVICE] if letter.isprintable())
