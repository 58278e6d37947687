"""Times of motion, for the audit log: who, how long, how far, why it ended. Pure."""

from dataclasses import dataclass, replace

from drive.motion.machine import State
from drive.motion.phases import Phase
from drive.motion.values import ZERO


@dataclass(frozen=True, slots=True)
class Episode:
    """A time of motion, from a hold to its end.

    Attributes:
        episode_id: counts up from 1.
        holder: who drove, for people.
        ended_ns: 0 while it lasts.
        distance_m, turned_rad: as commanded, which is not as measured.
        ended_by: for people; empty while it lasts.
        recorded: whether it is in the audit log.
    """

    episode_id: int
    holder: str
    started_ns: int
    ended_ns: int = 0
    distance_m: float = 0.0
    turned_rad: float = 0.0
    ended_by: str = ""
    recorded: bool = False

    @property
    def unrecorded(self) -> bool:
        """Whether it has ended and is still to be recorded."""
        return self.ended_ns > 0 and not self.recorded

    def ended(self, now_ns: int, why: str) -> "Episode":
        """Returns it with its end; one that has ended is as it was."""
        return self if self.ended_ns else replace(self, ended_ns=now_ns, ended_by=why)


def followed(last: Episode | None, before: State, after: State, now_ns: int) -> Episode | None:
    """Returns the newest episode after a step of the machine; None before the first."""
    driving = after.phase is Phase.DRIVING
    if driving and before.phase is not Phase.DRIVING:
        holder = after.lease.holder if after.lease else ""
        return Episode(last.episode_id + 1 if last else 1, holder, now_ns)
    if before.phase is not Phase.DRIVING or last is None:
        return last
    velocity, elapsed_s = before.output or ZERO, (now_ns - before.output_ns) / 1e9
    last = replace(
        last,
        distance_m=last.distance_m + velocity.linear_mps * elapsed_s,
        turned_rad=last.turned_rad + abs(velocity.wz_rad_s) * elapsed_s,
    )
    return last if driving else last.ended(now_ns, _why(before, after))


def _why(before: State, after: State) -> str:
    if after.latch:
        return f"stopped by {after.latch.by}" + (f": {after.latch.reason}" if after.latch.reason else "")
    if before.lease and after.lease and after.lease.session_id != before.lease.session_id:
        return f"taken over by {after.lease.holder}"
    if after.inhibits:
        return "; ".join(sorted(inhibit.value for inhibit in after.inhibits))
    if not after.enabled:
        return "driving was disabled"
    return "released" if after.lease else "the session ended"
