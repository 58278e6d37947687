"""What supervisors of the gateway see: the health service, and heartbeats that a hung part withholds."""

from typing import Final

from common import heartbeat
from common.health import Health
from gateway.rpc.server import SERVICE
from gateway.status.board import Board
from gateway.status.snapshot import Snapshot

PREVIEW_HEALTH: Final = "preview"
"""The preview service's name in the health service. The gateway serves without it."""
DRIVE_HEALTH: Final = "drive"
"""The drive program's name there, where the robot is set up for driving."""
RECORDER_HEALTH: Final = "recorder"
"""The recorder's name there, where the robot is set up for recording."""
BRIDGE_HEALTH: Final = "bridge"
"""The bridge's name there, where the robot is set up for a fleet."""
ROS_HUNG_AFTER_S: Final = 30.0
"""Without a pass of the ROS sampler: no load explains it, and only another process reads ROS again."""


class HealthReporter:
    """Keeps the health service and the heartbeats in step with the newest snapshot.

    Args:
        health: of the operators' server.
        board: knows when ROS was last read.
    """

    def __init__(self, health: Health, board: Board) -> None:
        self._health = health
        self._board = board

    def take(self, now: Snapshot) -> None:
        """Takes the snapshot of this instant."""
        health = self._health
        health.set_serving(SERVICE, serving=not (now.ros_stalled or now.access.closed))
        health.set_serving(PREVIEW_HEALTH, serving=now.preview.service_reachable)
        if now.teleop:
            health.set_serving(DRIVE_HEALTH, serving=now.teleop.drive.reachable)
        if now.recorder:
            health.set_serving(RECORDER_HEALTH, serving=now.recorder.reachable)
        if now.cloud:
            health.set_serving(BRIDGE_HEALTH, serving=now.cloud.reachable)
        heartbeat.own().withheld = hung_part(self._board, now.at_s)


def hung_part(board: Board, now_s: float) -> str:
    """Returns which part of this process hangs so that only a restart mends it, for the log; else ""."""
    passed_s = board.ros_passed_s
    if passed_s is None or now_s - passed_s <= ROS_HUNG_AFTER_S:
        return ""
    return f"ROS has not been read for {now_s - passed_s:.0f} s"
