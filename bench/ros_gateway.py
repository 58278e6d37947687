"""CPU of the whole gateway process beside a robot that publishes fast."""

import tempfile
import time
from pathlib import Path

from bench.processes import cpu_share, program
from bench.progress import log
from tests.support.gateway_program import gateway_program
from tests.support.ros import simulated_robot

FAST_HZ = 200
FRAMES_HZ = 30
BOXES = 100
SETTLE_S = 3.0
"""After the start: discovery and one-time work."""
ROUNDS = 5
WINDOW_S = 6.0
_FAST = ("--odometry-hz", "--vision-hz", "--battery-hz", "--diagnostics-hz")
_HEARD_WITHIN_S = 20.0


def cpu_percents() -> list[float]:
    """Returns percent of one core, round by round, in the ROS domain of the environment."""
    rates = [argument for option in _FAST for argument in (option, str(FAST_HZ))]
    with (
        tempfile.TemporaryDirectory() as directory,
        simulated_robot(Path(directory), *rates, "--detections-hz", "0"),
        program("tests.support.flood", str(BOXES), str(FRAMES_HZ)),
        gateway_program(Path(directory)) as gateway,
    ):
        deadline_s = time.monotonic() + _HEARD_WITHIN_S
        while gateway.overlay().detections.detection_count != BOXES or not gateway.status().health.ready:
            if time.monotonic() > deadline_s:
                raise RuntimeError("not everything that the robot publishes was heard")
            time.sleep(0.1)
        time.sleep(SETTLE_S)
        rounds = [cpu_share(gateway.process.pid, WINDOW_S) for _ in range(ROUNDS)]
        if gateway.overlay().detections.stale:
            raise RuntimeError("the detections stopped coming: the figure would mean nothing")
    for cpu in rounds:
        log(f"ros: whole gateway {cpu.own:.2f} % + {cpu.middleware:.2f} % in Fast DDS")
    return [cpu.whole for cpu in rounds]
