"""Gateway and driver's program in turn are frozen for 300 ms, a hundred times; the driver holds all the time.

Motion that follows by itself, afterwards, counts as if it had never ended.
"""

import signal
import time
from typing import Final

from bench.drive.ground import Ground, driver
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.driven_robot import DrivenRobot

ROUNDS: Final = FEWEST_ROUNDS
TIMES: Final = 20
FROZEN_S: Final = 0.3
QUIET_S: Final = 0.7


def rows(ground: Ground, _wanted: set[str]) -> list[Row]:
    with ground.robot() as robot:
        values = [moved_ms(robot) for _ in range(ROUNDS)]
    return [
        Row(
            name="drive.thawed_ms",
            what=(
                f"gateway and driver's program in turn frozen for {FROZEN_S * 1000:.0f} ms and thawed,"
                f" {ROUNDS * TIMES} times: until the base has zero"
            ),
            unit="ms",
            values=values,
            bar=280,
            judged="worst",
        )
    ]


def moved_ms(robot: DrivenRobot, times: int = TIMES) -> float:
    """Returns the longest motion after a freeze began."""
    longest_s = 0.0
    with driver(robot.target, "--stay") as hands:
        for number in range(times):
            process = (robot.gateway.process, hands.process)[number % 2]
            began_s = time.monotonic()
            process.send_signal(signal.SIGSTOP)
            time.sleep(FROZEN_S)
            process.send_signal(signal.SIGCONT)
            time.sleep(QUIET_S)
            longest_s = max(longest_s, robot.base.stopped_after_s(began_s))
            hands.ask("again")
    log(f"frozen and thawed {times} times: {longest_s * 1000:.1f} ms")
    return longest_s * 1000
