"""The process that moves the robot a little for `robot-drive doctor --pulse`.

The doctor is its guard (`drive.doctor.pulse_guard`). It ends with zeros, whatever happens: the doctor's end,
a stop, a driver, the robot's own stop.
"""

import json
import select
import socket
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from typing import Any, Final

from common.ros_node import OwnNode, ros_node
from drive.config import DriveSettings
from drive.doctor.facts import PulseFacts
from drive.doctor.graph import DISCOVERY_S
from drive.doctor.permission import Permission
from drive.motion.values import ZERO, Velocity
from drive.ros.base import VelocityPublisher
from drive.ros.subscriptions import is_still, newest, subscribe, velocity_of

BEAT: Final = b"."
"""A heartbeat; the only other packet is the result."""
PULSE_MPS: Final = 0.05
_PULSE_S: Final = 0.5
_SILENCE_S: Final = 3.0
_STEP_S: Final = 0.02


def run_pulse(settings: DriveSettings, doctor: socket.socket) -> None:
    """Moves the robot forward for half a second, then says nothing, and watches when it stops.

    Args:
        settings: of the drive program.
        doctor: takes heartbeats, and in the end the PulseFacts as JSON.

    Raises:
        UserError: ROS 2 can't be used.
    """
    with ros_node(OwnNode.DRIVE_PULSE) as node, closing(Permission(node, settings)) as permission:
        facts = _Pulse(node, settings, permission, doctor).run()
        # Before the node leaves the graph, which takes longer than the doctor waits for a heartbeat.
        doctor.send(json.dumps(asdict(facts)).encode())


class _Pulse:
    """One pulse. Nothing here is spun."""

    def __init__(
        self, node: Any, settings: DriveSettings, permission: Permission, doctor: socket.socket
    ) -> None:
        self._velocities = VelocityPublisher(node, settings.outputs)
        self._odometry = (
            subscribe(node, "nav_msgs/msg/Odometry", settings.odometry) if settings.odometry else None
        )
        self._permission = permission
        self._doctor = doctor
        self._fastest_mps: float | None = None
        self._still = False

    def run(self) -> PulseFacts:
        """Moves the robot and is silent, unless that is forbidden by what discovery has found."""
        self._steps(DISCOVERY_S, lambda _: False)
        if refusal := self._refusal():
            return PulseFacts(PULSE_MPS, None, None, f"was left out: {refusal}")
        stopped_after_s = None
        try:
            refusal = self._steps(_PULSE_S, self._moved)
            last_s = time.monotonic()
            refusal = refusal or self._steps(_SILENCE_S, lambda refusal: bool(refusal) or self._still)
            if self._still and not refusal:
                stopped_after_s = time.monotonic() - last_s
        finally:
            self._velocities.publish(ZERO)
            self._velocities.wait_until_acknowledged()
        ended_by = f"was ended early: {refusal}" if refusal else ""
        return PulseFacts(PULSE_MPS, self._fastest_mps, stopped_after_s, ended_by)

    def _moved(self, refusal: str) -> bool:
        """Moves the robot for another step; returns whether that is forbidden."""
        if not refusal:
            self._velocities.publish(Velocity(vx_mps=PULSE_MPS))
        return bool(refusal)

    def _steps(self, for_s: float, done: Callable[[str], bool]) -> str:
        """Calls `done` with the refusal of each step until it returns true or time is up.

        Returns:
            The last refusal; empty if there was none.
        """
        end_s = time.monotonic() + for_s
        while not done(refusal := self._refusal()) and time.monotonic() < end_s:
            # A report of the drive program ends the step: a stop counts at once.
            select.select(self._permission.sources, [], [], _STEP_S)
            self._watch()
        return refusal

    def _refusal(self) -> str:
        return self._doctors_refusal() or self._permission.refusal()

    def _doctors_refusal(self) -> str:
        """Sends a heartbeat; returns what is wrong with the doctor that should take it."""
        try:
            self._doctor.send(BEAT, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return "the doctor is frozen"
        except OSError:
            return "the doctor has gone"
        return ""

    def _watch(self) -> None:
        if message := newest(self._odometry):
            measured = velocity_of(message.twist)
            self._fastest_mps = max(self._fastest_mps or 0.0, measured.linear_mps)
            self._still = is_still(measured)
