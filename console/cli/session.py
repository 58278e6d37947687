"""The robot and the output of one run of robotctl."""

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import typer
from rich.console import Console, RenderableType

from common.errors import UserError
from common.printable import escaped
from console.cli.options import GlobalOptions, JsonOption, RobotOption, TargetOption, json_requested
from console.client import AsyncGatewayClient, GatewayClient
from console.credentials import Credentials
from console.presentation.json_form import json_form
from console.robots import NotChosenError, Robot, choose, read_credentials, read_robots_file
from console.target import parse_target

# In a pipe or a file long lines are better than broken ones.
_WIDTH_OF_A_FILE = 160


class Answer(Protocol):
    """A robot's answer to a call that it has carried out."""

    @property
    def message(self) -> str:
        """For people."""


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
        credentials.encrypts(parse_target(self.target))
        return credentials

    def show(self, document: Mapping[str, Any], view: RenderableType) -> None:
        """Prints the JSON document, or the view for people."""
        if self.as_json:
            print_json(self.out, document)
        else:
            self.out.print(view)

    def show_answer(self, answer: Answer) -> None:
        """Prints the answer as JSON, with "ok", or its message for people."""
        self.show({"ok": True, **json_form(answer)}, answer.message)


def standard_output() -> Console:
    """Returns standard output; without colours where it is not a terminal or NO_COLOR is set."""
    piped = not sys.stdout.isatty() and "COLUMNS" not in os.environ
    return Console(highlight=False, markup=False, emoji=False, width=_WIDTH_OF_A_FILE if piped else None)


def print_json(out: Console, value: Mapping[str, Any], *, on_one_line: bool = False) -> None:
    """Prints one JSON document and flushes the output."""
    text = json.dumps(value, indent=None if on_one_line else 2, allow_nan=False, ensure_ascii=False)
    # Results have no control characters, but the configuration in one is JSON, which can spell them.
    print(escaped(text), file=out.file, flush=True)


def session_of(
    context: typer.Context, target: str | None = None, robot: str | None = None, as_json: bool = False
) -> Session:
    """Returns a session on standard output. An option after the command's name overrides one before it.

    Raises:
        UserError: No robot has this name, none is chosen, or the file of known robots is wrong.
    """
    before: GlobalOptions = context.obj
    try:
        chosen, name = choose(target or before.target, robot or before.robot, os.environ)
    except NotChosenError as error:
        remedy = "Add --robot NAME, or type: robotctl robots default NAME"
        raise UserError(error.what, remedy, exit_code=error.exit_code) from error
    return Session(chosen, json_requested(context, as_json), standard_output(), name)


def with_session(function: Callable[..., None]) -> Callable[..., None]:
    """Returns the command of a function: with --target, --robot and --json, which make its first argument.

    Args:
        function: Takes the `Session`, and the command's own arguments and options by name.
    """

    @functools.wraps(function, assigned=("__module__", "__name__", "__qualname__", "__doc__"))
    def command(
        context: typer.Context,
        target: TargetOption = None,
        robot: RobotOption = None,
        as_json: JsonOption = False,
        **own: Any,
    ) -> None:
        function(session_of(context, target, robot, as_json), **own)

    take_parameters(command, function)
    return command


def take_parameters(command: Callable[..., None], function: Callable[..., None]) -> None:
    """Gives a command the parameters of the function that it calls, as options before its own.

    Args:
        command: Takes the context, its own options, and those of the function by name.
        function: Its first parameter is what the command makes for it.
    """
    _, *own = inspect.signature(function).parameters.values()
    context, *shared, _ = inspect.signature(command, follow_wrapped=False).parameters.values()
    parameters = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in (context, *own, *shared)]
    # Typer reads options from these two.
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # of any callable
    command.__annotations__ = {each.name: each.annotation for each in parameters}
