"""Reasons why the robot must not move now. Pure."""

from dataclasses import dataclass

from drive.values import MS, Command, Inhibit, Lease, Supervision, Surroundings


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
) -> frozenset[Inhibit]:
    """Returns all reasons why the holder of the lease must not move the robot.

    Args:
        lease: None without a driver: then there is nothing to inhibit.
        command: the newest of this lease; None before the first, which moves nothing.
        surroundings: as last observed.
        now_ns: the present instant.
        deadlines: as configured.
    """
    if lease is None:
        return frozenset()
    reasons = set[Inhibit]()
    if surroundings.robot_stopped:
        reasons.add(Inhibit.ROBOT_STOP)
    if not surroundings.base_present:
        reasons.add(Inhibit.BASE_ABSENT)
    if surroundings.outranked:
        reasons.add(Inhibit.OUTRANKED)
    if command is not None and lease.streaming:
        if now_ns > command.valid_until_ns:
            reasons.add(Inhibit.COMMAND_LATE)
        elif now_ns > command.echo_ns + deadlines.loop_ns:
            reasons.add(Inhibit.LOOP_LATE)
    if command is not None and lease.supervision is Supervision.PICTURE:
        reason = _picture(command, surroundings, now_ns, deadlines)
        if reason:
            reasons.add(reason)
    return frozenset(reasons)


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
