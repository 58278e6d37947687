"""CPU of a viewer without a window: direct delivery against SRT's own, at once, of the same stream."""

import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from bench.processes import cpu_seconds
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import camera
from console.receiver.delivery import DeliveryChoice

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 3.0
WATCH_S: Final = 10.0
LATENCY_MS: Final = 125


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    direct: list[float] = []
    srt: list[float] = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot, robot.preview():
        for _ in range(ROUNDS):
            shares = _round(robot.client.target)
            direct.append(shares[DeliveryChoice.DIRECT])
            srt.append(shares[DeliveryChoice.SRT])
            log(f"direct {direct[-1]:.1f} %, SRT's own {srt[-1]:.1f} % of a core")
    return [
        Row(
            name="video.receiver_cpu",
            what="CPU of robotctl view --headless: direct delivery against SRT's own, at once (720p30)",
            unit="% of a core",
            values=direct,
            references=srt,
            bar=1.15,
        )
    ]


def _round(target: str) -> dict[DeliveryChoice, float]:
    """Returns the share of a core that each viewer needs, in percent."""
    robotctl = [str(Path(sys.executable).parent / "robotctl"), "view", "--headless", "--target", target]
    with ExitStack() as stack:
        viewers = {}
        for choice in (DeliveryChoice.DIRECT, DeliveryChoice.SRT):
            command = [*robotctl, "--delivery", choice.value]
            viewers[choice] = stack.enter_context(subprocess.Popen(command, stdout=subprocess.DEVNULL))
            stack.callback(viewers[choice].terminate)
        time.sleep(SETTLE_S)
        before = {choice: cpu_seconds(each.pid) for choice, each in viewers.items()}
        begun_s = time.monotonic()
        time.sleep(WATCH_S)
        took_s = time.monotonic() - begun_s
        return {
            choice: 100 * (cpu_seconds(each.pid) - before[choice]) / took_s
            for choice, each in viewers.items()
        }
