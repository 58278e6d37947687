"""The drive program without shared memory: nodes that join and leave don't delay a velocity."""

from pathlib import Path

import psutil
import pytest

from common.ros_node import ros_node
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.driving import driving
from tests.support.promise import keeps

pytestmark = [pytest.mark.ros, pytest.mark.timed]

JOINING = 12


def threads(process: psutil.Process) -> set[str]:
    return {path.read_text().strip() for path in Path(f"/proc/{process.pid}/task").glob("*/comm")}


def test_nodes_that_join_and_leave_do_not_stop_the_robot(
    tmp_path: Path,
    ros_domain: int,  # noqa: ARG001  # for its effect
) -> None:
    with driving(tmp_path) as robot:
        assert robot.guard
        for process in (psutil.Process(robot.guard.pid), robot.worker):
            names = threads(process)
            assert any(name.startswith("dds.udp") for name in names)
            assert not any(name.startswith("dds.shm") for name in names)

        def stops() -> float:
            robot.drive()
            phases = []
            with robot.moving():
                for number in range(JOINING):
                    with ros_node(f"visitor_{number}"):
                        phases.append(robot.state().phase)
                phases.append(robot.state().phase)
            return sum(phase != pb.PHASE_DRIVING for phase in phases)

        keeps(0, "phases beside driving while nodes joined and left", stops, per_stalled_s=None)
