"""Whether the doctor may move the robot: asked before a pulse, and all through it."""

import time
from collections.abc import Sequence
from typing import Any, Final

from google.protobuf.message import DecodeError

from common.ros_node import OwnNode
from drive.config import DriveSettings
from drive.endpoint.client import StateReader
from drive.motion.values import MS
from drive.processes.stop_file import read_stops
from drive.ros.stop_input import stop_inputs
from omniseer.drive.v1 import drive_pb2 as pb

_SILENT_NS: Final = 1_500 * MS
"""The drive program reports twice a second while it rests."""


class Permission:
    """What may forbid a pulse: an operator, a driver, a stop, doubt.

    Args:
        node: of rclpy.
        settings: of the drive program.
    """

    def __init__(self, node: Any, settings: DriveSettings) -> None:
        self._node, self._settings = node, settings
        self._stops = stop_inputs(node, settings)
        self._state: pb.ActualState | None = None
        self._program: StateReader | None = None
        self._refusal = ""
        """For good."""
        try:
            self._program = StateReader(settings.socket)
            self._state = self._program.next()
        except (FileNotFoundError, ConnectionRefusedError):
            if latch := read_stops(settings.stop_path).latch:
                self._refusal = f"the robot was stopped by {latch.by}, and robot-drive does not run"
        except (OSError, DecodeError) as error:
            self._refusal = f"robot-drive does not answer at {settings.socket}: {error}"

    def close(self) -> None:
        """Disconnects from the drive program."""
        if self._program:
            self._program.close()

    @property
    def sources(self) -> Sequence[StateReader]:
        """What is readable as soon as the drive program reports something new."""
        return (self._program,) if self._program else ()

    def refusal(self) -> str:
        """Returns why the robot must not be moved at this instant, for people; empty if it may be."""
        # All are asked, so that each takes what has arrived.
        now_ns = time.monotonic_ns()
        pressed = [stop.topic for stop in self._stops if stop.active(now_ns)]
        self._read_program()
        if self._refusal:
            return self._refusal
        if refusal := _refusal_of(self._state) if self._state else self._unreached():
            return refusal
        return f"the robot's own stop is active on {', '.join(pressed)}" if pressed else ""

    def _unreached(self) -> str:
        """Returns that a drive program runs which could not be asked."""
        running = {OwnNode.DRIVE, OwnNode.DRIVE_GUARD} & set(self._node.get_node_names())
        return f"robot-drive runs, but nothing listens at {self._settings.socket}" if running else ""

    def _read_program(self) -> None:
        if self._program is None or self._refusal:
            return
        try:
            self._state = self._program.newest() or self._state
        except (OSError, DecodeError) as error:
            self._refusal = f"robot-drive has gone: {error}"


def _refusal_of(state: pb.ActualState) -> str:
    if time.monotonic_ns() - state.monotonic_ns > _SILENT_NS:
        return "robot-drive reports nothing any more"
    if state.HasField("stop"):
        return f"the robot was stopped by {state.stop.by}"
    if state.phase == pb.PHASE_DISABLED:
        return "driving is disabled"
    return "" if state.phase == pb.PHASE_AVAILABLE else "a driver has the robot"
