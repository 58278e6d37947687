"""What all commands of one run share: which robot, which form of output."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.console import Console

from common.errors import ExitCode, UserError
from console.client import AsyncGatewayClient, Credentials, GatewayClient, GatewayError, parse_target
from console.robots import Robot, choose, read_credentials, read_robots_file

# Where nobody looks at columns, lines are left long rather than broken.
_WIDTH_OF_A_FILE = 160


@dataclass(frozen=True, slots=True)
class Session:
    """One run of robotctl.

    Args:
        robot: how the robot is reached.
        as_json: print JSON instead of tables.
        out: standard output; without colours where it is no terminal or NO_COLOR is set.
        name: as the file of known robots calls it; None when only an address was given.
    """

    robot: Robot
    as_json: bool
    out: Console
    name: str | None = None

    @property
    def target(self) -> str:
        """The robot's gateway."""
        return self.robot.target

    def connect(self) -> GatewayClient:
        """A client for this run, to be used in a `with` block."""
        return GatewayClient(self.target, credentials=self.credentials())

    def connect_async(self) -> AsyncGatewayClient:
        """As `connect`, for the running loop: to be used in an `async with` block."""
        return AsyncGatewayClient(self.target, credentials=self.credentials())

    def credentials(self) -> Credentials:
        """What proves to the robot who asks, as it is stored at this moment.

        Raises:
            UserError: a file is missing, others may read a secret, or it would be sent in the clear.
        """
        shown = read_credentials(read_robots_file().find(self.name) if self.name else self.robot)
        # A window would learn that these won't do only in a thread of its own, too late for one line.
        shown.channel_credentials(parse_target(self.target))
        return shown

    def print_json(self, value: Mapping[str, Any], *, on_one_line: bool = False) -> None:
        """One JSON document, out at once."""
        print_json(self.out, value, on_one_line=on_one_line)


def open_session(target: str | None, robot: str | None, as_json: bool) -> Session:
    """A session on standard output with the robot that is meant.

    Raises:
        UserError: no robot has this name, or the file of known robots is wrong.
    """
    choice = choose(target, robot, os.environ)
    return Session(choice.robot, as_json, standard_output(), choice.name)


def standard_output() -> Console:
    """For people; without colours where it is no terminal or NO_COLOR is set."""
    piped = not sys.stdout.isatty() and "COLUMNS" not in os.environ
    return Console(highlight=False, markup=False, emoji=False, width=_WIDTH_OF_A_FILE if piped else None)


def print_json(out: Console, value: Mapping[str, Any], *, on_one_line: bool = False) -> None:
    """One JSON document, out at once."""
    text = json.dumps(value, indent=None if on_one_line else 2, allow_nan=False, ensure_ascii=False)
    print(text, file=out.file, flush=True)


def error_as_json(error: UserError) -> dict[str, Any]:
    """An error as scripts read it."""
    return {
        "kind": _kind(error),
        "what": " ".join(error.what.split()),
        "remedy": error.remedy,
        "exit_code": int(error.exit_code),
    }


def report(error: UserError) -> None:
    """One line on standard error; JSON where the command line asks for JSON."""
    if "--json" in sys.argv[1:]:
        print(json.dumps({"error": error_as_json(error)}, ensure_ascii=False), file=sys.stderr)
    else:
        print(f"error: {error}", file=sys.stderr)


def _kind(error: UserError) -> str:
    if isinstance(error, GatewayError):
        return error.kind
    return "usage" if error.exit_code is ExitCode.USAGE else "failed"
