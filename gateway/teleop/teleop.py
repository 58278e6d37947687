"""Driving as it runs: lanes and calls in, the lease decided, commands out to the drive program.

Failures, and what follows:

a driver's last lane ends, or it is silent for 2 s
    The lease ends. Lost while holding: the drive program stops the robot until a reset (its on_loss).
the drive program is gone, or its connection
    States say DRIVE_LOST. The session stays, and gets the lease again from the next process; its driver has
    to release and to hold again. A stop that is not confirmed is the first message that the next one gets.
driving is disabled
    The session ends, its lanes with TELEOP_DISABLED.
the computer was suspended
    The session ends as lost: what the driver sent may be as old as the suspend is long.
the gateway is gone
    The drive program sees the end of the connection, or the end of the last command's validity.
"""

import asyncio
import logging
import secrets
import time
from typing import Final, NoReturn, Protocol

from common.errors import ConflictError, DriveUnreachableError, PreconditionError, TooMuchError
from common.reasons import Reason
from common.suspend import SuspendWatch
from gateway.links.drive.commands import DriveCommands
from gateway.links.drive.state import DriveCommand, DriveLink, DriveSpec
from gateway.status.preview import PreviewView
from gateway.status.teleop import (
    DriveInhibit,
    DriveLimits,
    DrivePhase,
    DriveView,
    LeaseEnd,
    TeleopView,
)
from gateway.status.values import Received, Velocity
from gateway.teleop.episodes import Episodes
from gateway.teleop.lane import DriveFacts, Driving, Lane
from gateway.teleop.lease import (
    MAX_LANES,
    Answer,
    Demand,
    Driver,
    Lease,
    LeaseRefusedError,
    NotInSessionError,
    Session,
    TooManyLanesError,
)
from gateway.teleop.pacing import Pacing
from gateway.teleop.stops import CONFIRMED_WITHIN_S, HOW_TO_REACH, Stops, in_words

_log = logging.getLogger(__name__)

_CHECK_EVERY_S: Final = 0.05
_PICTURE_EVERY: Final = 8
"""Checks between two reports of the pictures, of which the drive program needs two a second."""
_SESSION_ID_BYTES: Final = 12
_OF_NO_DRIVER: Final = frozenset({DrivePhase.DISABLED, DrivePhase.STOPPED})
"""Phases that are the same for every driver."""
_OF_A_DRIVER: Final = frozenset(
    {
        DriveInhibit.COMMAND_LATE,
        DriveInhibit.LOOP_LATE,
        DriveInhibit.PICTURE_MISSING,
        DriveInhibit.PICTURE_STALE,
    }
)
"""Reasons that are those of one session."""
_NS_PER_MS: Final = 1_000_000


class Preview(Protocol):
    """The robot's preview."""

    @property
    def view(self) -> PreviewView:
        """Its state."""


class Teleop:
    """The lease, the commands and the stops of one robot. Used on one event loop.

    Args:
        link: to the drive program.
        commands: what it is sent beside the desired state.
        preview: whose pictures the drivers see.
        line_of_sight: whether driving without a picture is permitted.
        episodes: records times of motion, for which it needs to know who drives.

    Attributes:
        stops: of the robot.
        last_error: why the newest single command was refused; empty when it was not.
    """

    def __init__(
        self,
        link: DriveLink,
        commands: DriveCommands,
        preview: Preview,
        *,
        line_of_sight: bool,
        episodes: Episodes,
    ) -> None:
        self.link = link
        self.line_of_sight = line_of_sight
        self._commands = commands
        self._preview = preview
        self._episodes = episodes
        self.stops = Stops(link, commands)
        self._lease = Lease()
        self._driving: Driving | None = None
        self._granted: tuple[int, str] | None = None
        """The connection and the session that the lease was granted last."""
        self._command: Received[Velocity] | None = None
        self.last_error = ""
        self._suspends = SuspendWatch()
        self._access_ended = False
        """Whether the newest lease ended because its driver has lost access."""

    def view(self) -> TeleopView:
        """Returns what operators see, from memory."""
        drive, holder = self.link.view, self._lease.holder
        return TeleopView(
            drive=drive,
            inhibits=self._inhibits(drive),
            holder=holder.driver.name if holder else "",
            command=self._command,
            last_error=self.last_error,
        )

    def _inhibits(self, drive: DriveView) -> tuple[DriveInhibit, ...]:
        return (*_inhibits(drive), *((DriveInhibit.ACCESS_ENDED,) if self._access_ended else ()))

    # --- lanes ---

    def open_lane(self, driver: Driver, *, take_over: bool, line_of_sight: bool) -> Lane:
        """Opens the first lane of a new session.

        Raises:
            DomainError: the driver does not get the lease.
        """
        self._check_enabled()
        if self.limits is None:
            raise DriveUnreachableError(f"the robot's drive program does not answer: {HOW_TO_REACH}")
        if line_of_sight and not self.line_of_sight:
            raise PreconditionError(
                "this robot does not permit driving by line of sight: drive by the preview, or set "
                "teleop.line_of_sight in the gateway's configuration",
                Reason.SUPERVISION_NOT_PERMITTED,
            )
        demand = Demand.OPEN
        if take_over:
            demand = Demand.TAKE_OVER_AS_ADMIN if driver.admin else Demand.TAKE_OVER
        driving = self.acquire(driver, demand, line_of_sight=line_of_sight)
        return Lane(self, driving, self._lease.add_lane(driving.session, time.monotonic()))

    def join_lane(self, driver: Driver, session_id: str) -> Lane:
        """Opens another lane of a session.

        Raises:
            DomainError: it is not the driver's, has ended, or has as many as it may have.
        """
        self._check_enabled()
        try:
            session = self._lease.find(session_id, driver)
            number = self._lease.add_lane(session, time.monotonic())
        except NotInSessionError:
            raise ConflictError(
                "there is no such session of this driver; open a new one", Reason.LEASE_LOST
            ) from None
        except TooManyLanesError:
            raise TooMuchError(
                f"this session has {MAX_LANES} lanes; close one first", Reason.TOO_MANY_STREAMS
            ) from None
        assert self._driving is not None  # noqa: S101  # it belongs to the holder
        return Lane(self, self._driving, number)

    def close_lane(self, driving: Driving, number: int, why: LeaseEnd) -> None:
        """Closes a lane."""
        if self._lease.lane_gone(driving.session, number, why):
            self._end(driving.session, why)

    def lane_heard(self, driving: Driving, number: int) -> None:
        """Notes that a command has come on a lane, a copy or not."""
        self._lease.lane_heard(driving.session, number, time.monotonic())

    def take(self, driving: Driving, command: DriveCommand, input_device: str) -> None:
        """Takes a command of a lane, and passes it on unless it is a copy, or too many come."""
        now_s = time.monotonic()
        if not self._lease.take(driving.session, command.sequence, now_s, held=command.held):
            return
        if command.held and driving.device != input_device:
            driving.device = input_device
            self._episodes.note(driving.session.driver, input_device)
        driving.newest, driving.arrived_ns = command, time.monotonic_ns()
        if command.held or not driving.session.streaming:
            self._command, self.last_error = Received(command.velocity, now_s), ""
        self._pass_on(driving, driving.pacing.take(command, now_s))

    def facts(self, driving: Driving) -> DriveFacts:
        """Returns what a lane is sent."""
        drive, newest, now_ns = self.link.view, driving.newest, time.monotonic_ns()
        granted = self._is_granted(driving.session)
        phase, inhibits = drive.phase, _inhibits(drive)
        if phase is DrivePhase.AVAILABLE or (phase is DrivePhase.DISABLED and drive.enabled):
            # The lease is on its way to the drive program, or waits for it.
            phase = DrivePhase.ARMED if granted and drive.reachable else DrivePhase.INHIBITED
        elif not granted or _is_of_another(drive, driving.session):
            # Who was taken over from may have the lease there still: this driver's holds move nothing yet.
            phase = phase if phase in _OF_NO_DRIVER else DrivePhase.INHIBITED
            inhibits = tuple(each for each in inhibits if each not in _OF_A_DRIVER)
        return DriveFacts(
            now_ns=now_ns,
            drive=drive,
            phase=phase,
            inhibits=inhibits,
            newest_sequence=driving.session.sequence,
            command_age_ms=_age_ms(now_ns, driving.arrived_ns) or 0,
            loop_age_ms=(_age_ms(now_ns, newest.echo_ns) or 0) if newest else 0,
            picture_age_ms=_age_ms(now_ns, newest.picture_ns) if newest else None,
        )

    @property
    def limits(self) -> DriveLimits | None:
        """What the robot accepts; None until the drive program has said so."""
        actual = self.link.view.actual
        return actual.limits if actual else None

    async def set_enabled(self, *, enabled: bool) -> tuple[bool, str]:
        """Enables or disables driving; returns whether that is in force, and what happened, for people."""
        desired = self.link.request(DriveSpec(enabled=enabled))
        if not enabled and (driving := self._driving):
            self._lease.end(driving.session, LeaseEnd.DISABLED)
            self._end(driving.session, LeaseEnd.DISABLED)
        await self.link.wait_until_settled(desired, CONFIRMED_WITHIN_S)
        view = self.link.view
        if self.link.desired.revision != desired.revision:
            return False, f"replaced by a newer request: driving {self.link.desired.spec}"
        if not view.applied:
            return False, f"the robot's drive program does not answer: {HOW_TO_REACH}"
        stopped = f"; {in_words(view.stop)}" if view.stop else ""
        return True, f"driving is {desired.spec}{stopped}"

    # --- the lease and the drive program ---

    async def run(self) -> NoReturn:
        """Ends silent sessions and reports pictures, until cancelled."""
        checks = 0
        while True:
            await asyncio.sleep(_CHECK_EVERY_S)
            checks += 1
            if self._suspends.resumed() and (driving := self._driving):
                # For the drive program, which has noticed it itself, the driver is lost, too.
                self._lease.end(driving.session, LeaseEnd.LOST)
                self._end(driving.session, LeaseEnd.LOST)
            if silent := self._lease.silent(time.monotonic()):
                self._end(silent, silent.ended or LeaseEnd.LOST)
            if checks % _PICTURE_EVERY == 0:
                self._commands.picture(self._preview.view.newest_capture_ns(time.monotonic_ns()))

    async def follow(self) -> NoReturn:
        """Follows the drive program: a stop that it confirms late, and the lease, granted to each process."""
        seen: DriveView | None = None
        while True:
            await self.link.changes.wait_until(lambda: self.link.view is not seen)  # noqa: B023  # read at once
            seen = self.link.view
            self.stops.follow()
            self._grant()

    def _check_enabled(self) -> None:
        if not self.link.view.enabled:
            raise PreconditionError(
                "driving is disabled on this robot; an operator has to enable it",
                Reason.TELEOP_DISABLED,
            )

    def acquire(self, driver: Driver, demand: Demand, *, line_of_sight: bool) -> Driving:
        """Returns the session that has the lease after a demand.

        Raises:
            ConflictError: another driver has it.
        """
        session_id = secrets.token_urlsafe(_SESSION_ID_BYTES)
        now_s = time.monotonic()
        try:
            session, last = self._lease.acquire(
                session_id, driver, demand, now_s, line_of_sight=line_of_sight
            )
        except LeaseRefusedError as error:
            too_early = error.answer is Answer.REFUSE_TOO_EARLY
            advice = (
                "taking over is possible when they have not held for 2 s"
                if too_early
                else "take over when they have not held for 2 s (take_over)"
            )
            raise ConflictError(f"{error.holder} has the lease; {advice}", Reason.LEASE_HELD) from None
        if self._driving and self._driving.session is session:
            return self._driving
        if last:
            self._forget()
            _log.info("driving: %s has taken over from %s", driver.name, last.driver.name)
        self._driving, self._access_ended = Driving(session, Pacing(now_s)), False
        _log.info("driving: %s has the lease", driver.name)
        self._grant()
        self.link.changes.notify_all()
        return self._driving

    def _grant(self) -> None:
        """Grants the lease where it is not granted yet. A drive program that is disabled would ignore it."""
        driving, view = self._driving, self.link.view
        if driving is None or not (view.enabled and view.applied and view.reachable):
            return
        session = driving.session
        if not self._is_granted(session) and self._commands.grant(
            session.session_id,
            session.driver.name,
            line_of_sight=session.line_of_sight,
            streaming=session.streaming,
        ):
            self._granted = self._commands.connection, session.session_id

    def _is_granted(self, session: Session) -> bool:
        return self._granted == (self._commands.connection, session.session_id)

    def _end(self, session: Session, why: LeaseEnd) -> None:
        _log.info("driving: the lease of %s has ended: %s", session.driver.name, why.value)
        self._forget()
        self._access_ended = why is LeaseEnd.ACCESS_ENDED
        if self._granted and not self._is_granted(session):
            # Who was taken over from may have the lease there still: until this session was granted it, that
            # kept the robot from other sources.
            self._commands.end(self._granted[1], LeaseEnd.TAKEN_OVER)
        self._commands.end(session.session_id, why)
        self.link.changes.notify_all()

    def _forget(self) -> None:
        if self._driving and self._driving.later:
            self._driving.later.cancel()
        self._driving = None

    def _pass_on(self, driving: Driving, command: DriveCommand | None) -> None:
        if command:
            self._commands.command(driving.session.session_id, command)
        if driving.later:
            driving.later.cancel()
            driving.later = None
        due_in_s = driving.pacing.due_in_s
        if due_in_s is not None:
            driving.later = asyncio.get_running_loop().call_later(due_in_s, self._pass_on_later, driving)

    def _pass_on_later(self, driving: Driving) -> None:
        driving.later = None
        if driving.session.ended is None:
            self._pass_on(driving, driving.pacing.due(time.monotonic()))


def _is_of_another(drive: DriveView, session: Session) -> bool:
    """Returns whether the drive program reports the lease of another session."""
    reported = drive.actual.session_id if drive.actual else ""
    return reported not in {"", session.session_id}


def _inhibits(drive: DriveView) -> tuple[DriveInhibit, ...]:
    if not drive.reachable:
        return (DriveInhibit.DRIVE_LOST,)
    return drive.actual.inhibits if drive.actual else ()


def _age_ms(now_ns: int, since_ns: int) -> int | None:
    return max(0, now_ns - since_ns) // _NS_PER_MS if since_ns else None
