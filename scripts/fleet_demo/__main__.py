"""The command line of scripts/fleet-demo."""

import argparse
import os
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common.errors import ExitCode, UserError
from fleet_demo.check import check
from fleet_demo.parts import ROBOTS, FleetGround, fleet_ground, start_receiver, start_robot


def main() -> int:
    """Ends 0, or 1 with a reason."""
    parser = argparse.ArgumentParser(
        prog="scripts/fleet-demo",
        description="Three robots, a hub of three nodes, a store and a receiver here, until Ctrl-C.",
    )
    parser.add_argument("--check", action="store_true", help="run the main job once, say what was seen, end")
    is_check = parser.parse_args().check
    began_s = time.monotonic()
    try:
        with (
            tempfile.TemporaryDirectory(prefix="robot-fleet-demo-") as directory,
            fleet_ground(Path(directory)) as ground,
        ):
            if is_check:
                check(ground, time.monotonic() - began_s)
            else:
                _show(ground)
    except KeyboardInterrupt:
        return int(ExitCode.FAILED if is_check else ExitCode.DONE)
    except (UserError, AssertionError) as error:
        print(f"error: {error}", file=sys.stderr)
        if is_check:
            print("main job: failed", flush=True)
        return int(ExitCode.FAILED)
    if is_check:
        print("main job: ok", flush=True)
    return int(ExitCode.DONE)


def _show(ground: FleetGround) -> None:
    start_receiver(ground)
    for robot in ROBOTS:
        start_robot(ground, robot)
    home = f"XDG_CONFIG_HOME={shlex.quote(str(ground.home))}"
    robotctl = str(Path(sys.executable).parent / "robotctl")
    print(f"In a second terminal: {home} {robotctl} fleet events --follow")
    print(f"                      {home} {robotctl} fleet command lab1 snapshot")
    environment = os.environ | {"XDG_CONFIG_HOME": str(ground.home)}
    subprocess.run([robotctl, "fleet", "watch"], check=False, env=environment)  # noqa: S603 - of this checkout


if __name__ == "__main__":
    sys.exit(main())
