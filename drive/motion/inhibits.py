"""Reasons why no driver must move the robot now. Pure."""

from collections.abc import Iterator
from dataclasses import dataclass

from drive.motion.values import MS, Command, Inhibit, Lease, Supervision, Surroundings


@dataclass(frozen=True, slots=True)
class Deadlines:
    """How old what decides about motion may be.

    Attributes:
        command_ns: longest time that a command of a streaming session is valid after its arrival.
        unary_ns: time that a command without a stream is valid.
        loop_ns: largest age of the robot's clock that a command echoes.
        picture_ns: largest age of the driver's picture.
        clock_ns: how far a driver's estimate of the robot's clock may be ahead.
    """

    command_ns: int = 250 * MS
    unary_ns: int = 500 * MS
    loop_ns: int = 400 * MS
    picture_ns: int = 600 * MS
    clock_ns: int = 20 * MS


def inhibits(
    lease: Lease | None,
    command: Command | None,
    surroundings: Surroundings,
    now_ns: int,
    deadlines: Deadlines,
    *,
    publishing: bool,
) -> frozenset[Inhibit]:
    """Returns all reasons why a driver must not move the robot: its own also without a driver.

    Args:
        lease: None without a driver.
        command: the newest of this lease; None before the first, which moves nothing.
        surroundings: as last observed.
        now_ns: the present instant.
        deadlines: as configured.
        publishing: whether velocities or zeros are published.
    """
    reasons = set[Inhibit]()
    if surroundings.robot_stopped:
        reasons.add(Inhibit.ROBOT_STOP)
    if not surroundings.base_present:
        reasons.add(Inhibit.BASE_ABSENT)
    # What moves the robot while nothing is published here need not outrank a driver.
    if surroundings.outranked and (lease is not None or publishing):
        reasons.add(Inhibit.OUTRANKED)
    if lease is not None and command is not None:
        reasons.update(_of_the_driver(lease, command, surroundings, now_ns, deadlines))
    return frozenset(reasons)


def _of_the_driver(
    lease: Lease, command: Command, surroundings: Surroundings, now_ns: int, deadlines: Deadlines
) -> Iterator[Inhibit]:
    """Yields what is wrong with the newest command, and with the picture that it reports."""
    if lease.streaming:
        if now_ns > command.valid_until_ns:
            yield Inhibit.COMMAND_LATE
        elif now_ns > command.echo_ns + deadlines.loop_ns:
            yield Inhibit.LOOP_LATE
    if lease.supervision is Supervision.PICTURE:
        reason = _picture(command, surroundings, now_ns, deadlines)
        if reason:
            yield reason


def _picture(
    command: Command, surroundings: Surroundings, now_ns: int, deadlines: Deadlines
) -> Inhibit | None:
    """Returns what is wrong with the driver's picture.

    A capture time that the robot can't have sent counts as none: the driver's program errs, or lies.
    """
    if command.picture_ns <= 0 or not surroundings.preview_running:
        return Inhibit.PICTURE_MISSING
    if command.picture_ns > min(now_ns, surroundings.newest_capture_ns) + deadlines.clock_ns:
        return Inhibit.PICTURE_MISSING
    return Inhibit.PICTURE_STALE if now_ns - command.picture_ns > deadlines.picture_ns else None
