"""The commands of a driver's session: hold to run, and no way to forget the stop. Pure.

A command says until when it is valid, 250 ms from now on the robot's clock, of which the driver's program has
a bound that is never ahead of it (console.client.robot_clock). So a command that was held up on its way
moves nothing, whatever the two clocks show.
"""

import math
from dataclasses import dataclass
from typing import Final

from console.client.mapping.driving import DriveCommand
from console.client.robot_clock import RobotClock

HOLD_COUNTS_S: Final = 0.1
"""A hold that is not renewed for this long is a release: the program that reads the driver's hands hangs.
When it goes on, its driver has to release and to hold again: no recovery of a program moves the robot."""
VALID_S: Final = 0.25
"""Longest validity of a command after it was made."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Hold:
    """What the driver's hands ask for.

    Attributes:
        vx_mps: Forward, in the robot's frame.
        vy_mps: To the left.
        wz_rad_s: Turning rate, counter-clockwise.
        input_device: What the driver steers with.
        at_s: When they asked, on the monotonic clock.
    """

    vx_mps: float
    vy_mps: float
    wz_rad_s: float
    input_device: str
    at_s: float


class Commands:
    """Makes the commands from what the driver holds.

    `hold` and `release` may be called from any thread, all else in the session's loop.

    Args:
        input_device: What a command that does not hold names.

    Attributes:
        sequence: Of the newest command.
        holds: Whether that one holds.
    """

    def __init__(self, input_device: str) -> None:
        self._input_device = input_device
        self._hold: Hold | None = None
        self._lapsed = False
        self._let_go = False
        """Whether the driver has released since the last command was made; it is then no hold in any case."""
        self._released = True
        """Whether a command that is no hold has left since the last hold: only then a new one begins."""
        self._release = 0
        """The first command that is no hold after the last that was one."""
        self._ended = False
        self.sequence = 0
        self.holds = False

    @property
    def held(self) -> bool:
        """Whether the driver holds."""
        return self._hold is not None

    @property
    def lapsed(self) -> bool:
        """Whether a hold was not renewed in time: until a release, no other counts."""
        return self._lapsed

    def hold(self, hold: Hold) -> None:
        """Takes a hold, which counts for HOLD_COUNTS_S.

        Raises:
            ValueError: A velocity is not finite.
        """
        self._lapsed = self._lapsed or self._unrenewed(hold.at_s)
        if not all(map(math.isfinite, (hold.vx_mps, hold.vy_mps, hold.wz_rad_s))):
            raise ValueError("a velocity has to be finite")
        self._hold = hold

    def release(self) -> bool:
        """Takes a release; returns whether the driver held."""
        self._lapsed = False
        held = self._hold is not None
        if held:
            self._let_go = True
        self._hold = None
        return held

    def end(self) -> None:
        """Ends the holds, for good: the session ends. Another thread may hold on until it knows."""
        self._ended, self._hold = True, None

    def make(self, now_s: float, robot_clock: RobotClock, picture_ns: int) -> DriveCommand:
        """Returns the next command.

        Args:
            now_s: On the monotonic clock.
            robot_clock: Its newest instant is echoed.
            picture_ns: When the picture that the driver sees was captured, on the robot's clock; 0: none.
        """
        hold = self._hold
        if self._ended or self._let_go or self._lapsed or self._unrenewed(now_s):
            self._let_go, hold = False, None
        if hold is None and self.holds:
            self._released, self._release = False, self.sequence + 1
        if hold and not self.holds and not self._released:
            # The release before it has not left yet; without it this would be the same hold, going on.
            hold = None
        self.sequence += 1
        self.holds = hold is not None
        return DriveCommand(
            sequence=self.sequence,
            held=hold is not None,
            vx_mps=hold.vx_mps if hold else 0.0,
            vy_mps=hold.vy_mps if hold else 0.0,
            wz_rad_s=hold.wz_rad_s if hold else 0.0,
            echo_monotonic_ns=robot_clock.newest_ns,
            picture_monotonic_ns=picture_ns,
            valid_until_monotonic_ns=robot_clock.at_ns(now_s) + int(VALID_S * _NS_PER_S),
            input_device=hold.input_device if hold else self._input_device,
        )

    def left(self, sequence: int, *, held: bool) -> None:
        """Notes that a command has left on a lane, which may be slower than another one."""
        self._released = self._released or (not held and sequence >= self._release)

    def _unrenewed(self, now_s: float) -> bool:
        """Whether there is a hold, and it counts no more."""
        hold = self._hold
        return hold is not None and now_s - hold.at_s > HOLD_COUNTS_S
