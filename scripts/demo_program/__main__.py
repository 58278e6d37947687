"""The command line of scripts/demo."""

import argparse
import os
import sys
import time
from pathlib import Path

from common.errors import ExitCode, UserError
from common.program import end_with

# Before the client's import reads it: gRPC's own log lines would break into the table.
os.environ.setdefault("GRPC_VERBOSITY", "NONE")

from demo_program.check import check
from demo_program.ground import DEFAULT_GRPC_PORT, DEFAULT_SRT_PORT, Ground, Options, prepared
from demo_program.interruption import Interruption
from demo_program.programs import ProgramError, Programs
from demo_program.show import show
from demo_program.sources import parse_source


def main() -> int:
    """Ends 0, or 1 with a reason and the end of each log."""
    options, is_check = _command_line()
    interruption = Interruption()
    try:
        with prepared(options) as ground:
            try:
                with Programs(ground, interruption) as programs:
                    (check if is_check else show)(ground, programs, _began_s())
            except KeyboardInterrupt:
                if is_check:
                    print("main job: interrupted", flush=True)
                return int(ExitCode.FAILED if is_check else ExitCode.DONE)
            except UserError as error:
                ground.keep_logs()
                print(f"error: {error}", file=sys.stderr)
                return _failed(is_check, _log_tails(ground, error))
    except KeyboardInterrupt:
        return int(ExitCode.FAILED)
    except UserError as error:
        end_with(error)
    if is_check:
        print("main job: ok", flush=True)
    return int(ExitCode.DONE)


def _log_tails(ground: Ground, error: UserError) -> str:
    """The end of the log of the program that failed; of all logs where it is not known which did."""
    return ground.log_tails(error.program if isinstance(error, ProgramError) else "")


def _failed(is_check: bool, tails: str) -> int:
    print(tails, file=sys.stderr)
    if is_check:
        print("main job: failed", flush=True)
    return int(ExitCode.FAILED)


def _began_s() -> float:
    """When scripts/demo began, on the monotonic clock: setup counts as a step."""
    began = os.environ.get("DEMO_BEGAN", "").replace(",", ".")
    return time.monotonic() - (time.time() - float(began) if began else 0.0)


def _command_line() -> tuple[Options, bool]:
    parser = argparse.ArgumentParser(
        prog="scripts/demo",
        description="Simulated robot, gateway, preview and robot-drive on this machine, until Ctrl-C.",
    )
    parser.add_argument("--check", action="store_true", help="run the main job once, say what was seen, end")
    parser.add_argument(
        "--source",
        default="test",
        metavar="test|file:PATH|v4l2:DEVICE|gst:DESCRIPTION",
        help="where the pictures come from (a moving test picture)",
    )
    free = "any free one with --check"
    parser.add_argument(
        "--grpc-port", type=_port, help=f"the gateway's TCP port ({DEFAULT_GRPC_PORT}; {free})"
    )
    parser.add_argument("--srt-port", type=_port, help=f"the stream's UDP port ({DEFAULT_SRT_PORT}; {free})")
    parser.add_argument("--domain", type=_domain, help="the ROS domain (one that nothing uses)")
    arguments = parser.parse_args()
    try:
        source = parse_source(arguments.source, Path.cwd())
    except UserError as error:
        parser.error(str(error))
    options = Options(source, arguments.grpc_port, arguments.srt_port, arguments.domain, arguments.check)
    return options, arguments.check


def _port(text: str) -> int:
    return _number(text, 1, 65535)


def _domain(text: str) -> int:
    # Beyond 101 a domain's ports reach into the range of ephemeral ports of Linux.
    return _number(text, 0, 101)


def _number(text: str, lowest: int, highest: int) -> int:
    if not text.isdecimal() or not lowest <= int(text) <= highest:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from {lowest} to {highest}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
