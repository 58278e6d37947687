"""One lane of a driver's session: commands in, what the driver has to know out."""

import asyncio
import math
import time
from dataclasses import dataclass
from typing import Final, Protocol

from common.errors import (
    ConflictError,
    DomainError,
    InvalidRequestError,
    PreconditionError,
    TooMuchError,
)
from common.reasons import Reason
from common.token_bucket import TokenBucket
from gateway.links.drive.state import DriveCommand
from gateway.status.teleop import DriveInhibit, DrivePhase, DriveView, LeaseEnd
from gateway.status.values import Velocity
from gateway.teleop.lease import LANE_SILENT_S, Session
from gateway.teleop.pacing import Pacing

COMMANDS_PER_S: Final = 200.0
"""On one lane; any more close it. A second's worth may come at once, after an outage of the network."""


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """What the answers on a lane say of its own session, beside the state of the drive program.

    Attributes:
        now_ns: the instant.
        inhibits: of the drive program and of the gateway.
        newest_sequence: that has arrived; 0 before the first.
        command_age_ms, loop_age_ms: 0 before the first.
        picture_age_ms: None without a picture.
    """

    now_ns: int
    drive: DriveView
    phase: DrivePhase
    inhibits: tuple[DriveInhibit, ...]
    newest_sequence: int
    command_age_ms: int
    loop_age_ms: int
    picture_age_ms: int | None


@dataclass(eq=False, slots=True)
class Driving:
    """A session with what its commands need.

    Attributes:
        newest: the newest command that has arrived, passed on or not.
        arrived_ns: when it arrived.
        device: what the driver has held with last; None before the first hold.
        later: passes the command on that waits.
    """

    session: Session
    pacing: Pacing[DriveCommand]
    newest: DriveCommand | None = None
    arrived_ns: int = 0
    device: str | None = None
    later: asyncio.TimerHandle | None = None


class LaneOwner(Protocol):
    """What lanes belong to."""

    def lane_heard(self, driving: Driving, number: int) -> None:
        """Notes that a command has come on a lane."""

    def take(self, driving: Driving, command: DriveCommand, input_device: str) -> None:
        """Takes a command of a lane."""

    def facts(self, driving: Driving) -> DriveFacts:
        """Returns what a lane is sent."""

    def close_lane(self, driving: Driving, number: int, why: LeaseEnd) -> None:
        """Closes a lane."""


class Lane:
    """One lane of a session. Closed once, by the first of its tasks that finds it ended.

    Args:
        teleop: the lane's owner.
        driving: the session.
        number: of the lane.
    """

    def __init__(self, teleop: "LaneOwner", driving: Driving, number: int) -> None:
        self._teleop = teleop
        self._driving = driving
        self._number = number
        self._bucket = TokenBucket(COMMANDS_PER_S, time.monotonic())
        self._open = True

    @property
    def session_id(self) -> str:
        """Names the session."""
        return self._driving.session.session_id

    def take(self, command: DriveCommand, input_device: str) -> None:
        """Takes a command; one that another lane has brought already counts for nothing.

        Raises:
            InvalidRequestError: a value of it can't be.
            TooMuchError: there are too many.
        """
        now_s = time.monotonic()
        if not self._bucket.take(now_s, capacity=COMMANDS_PER_S, refill_per_s=COMMANDS_PER_S):
            raise TooMuchError(
                f"this lane brings more than {COMMANDS_PER_S:g} commands a second; 50 are enough",
                Reason.TOO_MANY_REQUESTS,
                1.0,
            )
        if not is_finite(command.velocity):
            raise InvalidRequestError("a velocity is not finite; send numbers, and 0 for no motion")
        self._teleop.lane_heard(self._driving, self._number)
        self._teleop.take(self._driving, command, input_device)

    def facts(self) -> DriveFacts:
        """Returns what the driver has to know at this instant.

        Raises:
            DomainError: the session has ended, or another lane has taken the place of this one.
        """
        session = self._driving.session
        if session.ended:
            raise _ended(session.ended)
        if self._number not in session.lanes:
            raise TooMuchError(
                f"this lane has brought nothing for {LANE_SILENT_S:g} s, and another one has taken its place",
                Reason.TOO_MANY_STREAMS,
                1.0,
            )
        return self._teleop.facts(self._driving)

    def close(self, why: LeaseEnd) -> None:
        """Closes the lane, and with the last one the session. Idempotent."""
        if self._open:
            self._open = False
            self._teleop.close_lane(self._driving, self._number, why)


def is_finite(velocity: Velocity) -> bool:
    """Returns whether no component is NaN or infinite."""
    return all(map(math.isfinite, (velocity.vx_mps, velocity.vy_mps, velocity.wz_rad_s)))


def _ended(why: LeaseEnd) -> DomainError:
    if why is LeaseEnd.DISABLED:
        return PreconditionError("driving was disabled by an operator", Reason.TELEOP_DISABLED)
    return ConflictError(f"the session has ended: {why.value}; open a new one", Reason.LEASE_LOST)
