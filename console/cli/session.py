"""The robot and the output of one run of robotctl."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.console import Console, RenderableType

from common.errors import ExitCode, UserError
from console.client import AsyncGatewayClient, Credentials, GatewayClient, GatewayError, parse_target
from console.client.printable import escaped
from console.robots import Robot, read_credentials, read_robots_file

# In a pipe or a file long lines are better than broken ones.
_WIDTH_OF_A_FILE = 160


@dataclass(frozen=True, slots=True)
class Session:
    """One run of robotctl.

    Args:
        robot: How to reach the robot.
        as_json: Whether to print JSON instead of tables.
        out: Standard output; without colours where it is not a terminal or NO_COLOR is set.
        name: The robot's name in the file of known robots; None when only an address was given.
    """

    robot: Robot
    as_json: bool
    out: Console
    name: str | None = None

    @property
    def target(self) -> str:
        """The address of the robot's gateway."""
        return self.robot.target

    def connect(self) -> GatewayClient:
        """Returns a client, to be used in a `with` block."""
        return GatewayClient(self.target, credentials=self.credentials())

    def connect_async(self) -> AsyncGatewayClient:
        """Returns a client for the running loop, to be used in an `async with` block."""
        return AsyncGatewayClient(self.target, credentials=self.credentials())

    def credentials(self) -> Credentials:
        """Returns the robot's credentials as they are stored now.

        Raises:
            UserError: A file is missing, other users may read a secret, or it would be sent in the clear.
        """
        credentials = read_credentials(read_robots_file().find(self.name) if self.name else self.robot)
        # A window would find that out in a thread of its own, too late for an error on one line.
        credentials.channel_credentials(parse_target(self.target))
        return credentials

    def show(self, document: Mapping[str, Any], view: RenderableType) -> None:
        """Prints the JSON document, or the view for people."""
        if self.as_json:
            print_json(self.out, document)
        else:
            self.out.print(view)


def standard_output() -> Console:
    """Returns standard output; without colours where it is not a terminal or NO_COLOR is set."""
    piped = not sys.stdout.isatty() and "COLUMNS" not in os.environ
    return Console(highlight=False, markup=False, emoji=False, width=_WIDTH_OF_A_FILE if piped else None)


def print_json(out: Console, value: Mapping[str, Any], *, on_one_line: bool = False) -> None:
    """Prints one JSON document and flushes the output."""
    text = json.dumps(value, indent=None if on_one_line else 2, allow_nan=False, ensure_ascii=False)
    # Results have no control characters, but the configuration in one is JSON, which can spell them.
    print(escaped(text), file=out.file, flush=True)


def error_as_json(error: UserError) -> dict[str, Any]:
    """Returns the JSON form of an error."""
    own = "usage" if error.exit_code is ExitCode.USAGE else "failed"
    return {
        "kind": error.kind if isinstance(error, GatewayError) else own,
        "what": " ".join(error.what.split()),
        "remedy": error.remedy,
        "exit_code": int(error.exit_code),
    }


def report(error: UserError) -> None:
    """Prints an error on one line of standard error; as JSON where the command line has --json."""
    if "--json" in sys.argv[1:]:
        print(escaped(json.dumps({"error": error_as_json(error)}, ensure_ascii=False)), file=sys.stderr)
    else:
        print(f"error: {error}", file=sys.stderr)
