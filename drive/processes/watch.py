"""How long the worker may be silent, and what its silence means. Pure."""

from dataclasses import dataclass
from typing import Final

from drive.motion.values import MS

START_NS: Final = 20_000 * MS
"""From the start of the process to its first heartbeat; imports and the discovery of ROS take seconds."""
DRIVING_NS: Final = 60 * MS
"""Three cycles, while a driver may move the robot."""
RESTING_NS: Final = 2_000 * MS
"""Without a driver: nothing is published that could go on."""


@dataclass(slots=True)
class Watch:
    """The deadline of the next heartbeat.

    Attributes:
        deadline_ns: when the worker has been silent for too long.
        began: whether there has been a heartbeat.
        heard_ns: when the last heartbeat came; before the first, when the process was started.
        leased: whether a driver had the lease, or a stop was latched, at the last heartbeat.
    """

    deadline_ns: int
    heard_ns: int
    began: bool = False
    leased: bool = False
    _excused: bool = False

    @classmethod
    def started(cls, now_ns: int) -> "Watch":
        """Returns the watch of a process that has just been started."""
        return cls(now_ns + START_NS, now_ns)

    def beat(self, now_ns: int, *, leased: bool) -> None:
        """Records a heartbeat."""
        self.began, self.leased, self._excused = True, leased, False
        self.heard_ns = now_ns
        self.deadline_ns = now_ns + (DRIVING_NS if leased else RESTING_NS)

    def silent(self, now_ns: int) -> bool:
        """Whether the worker has been silent for too long.

        A guard that looks a whole period too late was frozen itself, with the machine or its container, and
        perhaps its worker with it: once, the worker is given another period.
        """
        if now_ns < self.deadline_ns:
            return False
        if not self._excused and now_ns >= self.deadline_ns + DRIVING_NS:
            self._excused = True
            self.deadline_ns = now_ns + DRIVING_NS
            return False
        return True
