"""The practice robot: the drive program's own decisions, and a base that follows them. Pure.

What `drive.processes.worker` does with the real machine and the graph, this does with the same machine,
default rules, and the double of the base that simrobot has.
"""

from dataclasses import replace
from typing import Final

from drive.motion.machine import EndLease, Event, GrantLease, Observe, Rules, State, Tick, step
from drive.motion.shaping import supervised_limit_mps, supervised_limit_rad_s
from drive.motion.values import MS, ZERO, Command, LeaseEnd, Surroundings
from simrobot.base import Base, Twist
from simrobot.motion import Pose

_SILENCE_NS: Final = 2_000 * MS
"""Without a command for so long a session ends, as in the gateway (gateway/teleop/lease.py)."""


class PracticeRobot:
    """Takes events, and moves. Instants are ns of CLOCK_MONOTONIC, never earlier than the last.

    Args:
        now_ns: the instant of its beginning.

    Attributes:
        rules: limits and deadlines: the drive program's defaults.
        state: of the machine.
        pose: where the robot is.
        preview_on: whether pictures leave the robot.
        captured_ns: when the newest picture was captured; the camera's thread sets it.
    """

    def __init__(self, now_ns: int) -> None:
        self.rules = Rules()
        self.state = State.at_start(now_ns, enabled=True)
        self.pose = Pose()
        self.preview_on = True
        self.captured_ns = 0
        self._base = Base()
        self._moved_ns = now_ns
        self._heard_ns = now_ns

    def feed(self, event: Event, now_ns: int) -> None:
        """Takes an event. A zero that follows from it reaches the base at once."""
        if isinstance(event, Command | GrantLease):
            self._heard_ns = now_ns
        before, self.state = self.state, step(self.state, event, now_ns, self.rules)
        if self.state.output == ZERO != before.output:
            self._publish(now_ns)

    def advance(self, now_ns: int) -> None:
        """Moves to the present instant, looks around, and publishes, as in a cycle of the drive program."""
        self.pose.drive(self.velocity(now_ns), (now_ns - self._moved_ns) / 1e9)
        self._moved_ns = now_ns
        lease = self.state.lease
        if lease and now_ns - self._heard_ns >= _SILENCE_NS:
            self.feed(EndLease(lease.session_id, LeaseEnd.LOST), now_ns)
        self.feed(Observe(self._surroundings(now_ns)), now_ns)
        self.feed(Tick(), now_ns)
        self._publish(now_ns)

    def velocity(self, now_ns: int) -> Twist:
        """Returns how the base moves."""
        return self._base.velocity(now_ns / 1e9)

    def speed_limit_mps(self, now_ns: int) -> float:
        """Returns the largest speed that the driver's way of seeing permits now; 0 without a driver."""
        lease, limits = self.state.lease, self.rules.limits
        if lease is None:
            return 0.0
        limit_mps = supervised_limit_mps(lease.supervision, self._picture_age_s(now_ns), limits)
        return min(limit_mps, limits.vx_mps)

    def turn_limit_rad_s(self, now_ns: int) -> float:
        """Returns the largest turning rate that it permits, likewise."""
        lease, limits = self.state.lease, self.rules.limits
        if lease is None:
            return 0.0
        limit_rad_s = supervised_limit_rad_s(lease.supervision, self._picture_age_s(now_ns), limits)
        return min(limit_rad_s, limits.wz_rad_s)

    def _picture_age_s(self, now_ns: int) -> float:
        command = self.state.command
        return (now_ns - (command.picture_ns if command else 0)) / 1e9

    def _surroundings(self, now_ns: int) -> Surroundings:
        return replace(
            self.state.surroundings,
            preview_running=self.preview_on,
            newest_capture_ns=self.captured_ns,
            base_present=True,
            still=self.velocity(now_ns) == Twist(),
        )

    def _publish(self, now_ns: int) -> None:
        if output := self.state.output:
            self._base.receive(Twist(output.vx_mps, output.vy_mps, output.wz_rad_s), now_ns / 1e9)
