"""The demo for people: a live table, and what to type in a second terminal."""

import shlex
import sys
import time
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from common.errors import UserError
from console.cli.tables import status_view
from console.client import GatewayClient, SystemStatus
from console.presentation.status_line import status_line
from demo_program.ground import DEFAULT_GRPC_PORT, Ground
from demo_program.programs import Programs
from demo_program.ready import status_or_none, wait_until_up

_LOOK_EVERY_S: Final = 0.5
_LINE_EVERY_S: Final = 5.0
_SRT_LATENCY_MS: Final = 125


def show(ground: Ground, programs: Programs, _began_s: float) -> None:
    """Shows the status until KeyboardInterrupt. Raises UserError when a program ends by itself."""
    console = Console(highlight=False, markup=False, emoji=False)
    with GatewayClient(ground.target) as robot:
        console.print("starting the simulated robot, preview, drive program and gateway ...")
        wait_until_up(ground, programs, robot)
        console.print(Text(hints(ground)), soft_wrap=True)
        if console.is_terminal:
            _table(console, robot, programs)
        else:
            _lines(robot, programs)


def hints(ground: Ground) -> str:
    """What to type in a second terminal."""
    target = "" if ground.grpc_port == DEFAULT_GRPC_PORT else f" --target {ground.target}"
    uri = f"srt://127.0.0.1:{ground.srt_port}"
    silence = f"control silence odometry --control {shlex.quote(str(ground.control_socket))}"
    play = (
        f"gst-launch-1.0 srtsrc uri={uri} latency={_SRT_LATENCY_MS} "
        "! tsdemux latency=0 ! decodebin ! autovideosink sync=false"
    )
    return f"""
In a second terminal, for example:
  .venv/bin/robotctl{target} monitor    (the operator's window: video, status, faults, plots)
  .venv/bin/robotctl{target} view       (the video alone; p switches it on)
  .venv/bin/robotctl{target} preview on --profile balanced
  .venv/bin/robotctl{target} watch
  .venv/bin/robotctl{target} overlay
  .venv/bin/robotctl{target} drive      (w a s d while the key is down; space stops, r resets that, x ends)
  .venv/bin/robotctl{target} stop       (stops it, no matter who drives; r in drive ends that)
  .venv/bin/simrobot {silence}    (resume brings it back)
While the preview runs, its picture:
  ffplay -fflags nobuffer -flags low_delay '{uri}?latency={_SRT_LATENCY_MS * 1000}'
  {play}
Logs: {ground.directory}/*.log (removed at the end). Ctrl-C ends all.
"""


def _table(console: Console, robot: GatewayClient, programs: Programs) -> None:
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        while True:
            programs.check_alive()
            live.update(_view(status_or_none(robot), robot.target), refresh=True)
            time.sleep(_LOOK_EVERY_S)


def _view(status: SystemStatus | None, target: str) -> RenderableType:
    if status is None:
        return Text(f"{target} does not answer", style="bold red")
    return Group(status_view(status, target))


def _lines(robot: GatewayClient, programs: Programs) -> None:
    while True:
        programs.check_alive()
        status = status_or_none(robot)
        if status is None:
            raise UserError(f"{robot.target} does not answer")
        print(status_line(status), file=sys.stdout, flush=True)
        next_s = time.monotonic() + _LINE_EVERY_S
        while time.monotonic() < next_s:
            programs.check_alive()
            time.sleep(_LOOK_EVERY_S)
