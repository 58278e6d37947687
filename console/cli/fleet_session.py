"""The hub and the output of one run of `robotctl fleet`."""

import functools
import importlib
import os
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, TypeAlias

import typer
from rich.console import Console, RenderableType

from common.errors import ExitCode, UserError
from console.cli.options import JsonOption, json_requested
from console.cli.session import print_json, standard_output, take_parameters
from console.fleet.login import FleetLogin, login_of_servers, read_fleet_login

if TYPE_CHECKING:
    from fleet.connection import Hub

HUB_VARIABLE: Final = "ROBOTCTL_HUB"
ANSWERS_WITHIN_S: Final = 5.0
"""For a connection with one of the hub's servers; a silent one is no reason to wait (fleet/opening.py)."""
_INSTALL: Final = "Type, in a clone of the project: scripts/install-console"
_NOT_SET_UP: Final = "The hub's administrator types: robot-bridge hub apply"
_REMEDIES: Final = {
    "unreachable": "Check the network to the hub; docs/fleet.md lists what else it can be",
    "refused": "Ask the hub's administrator for a new login, and type: robotctl fleet login FILE --replace",
    "timeout": "Try again; if that stays so, look at the hub's servers (docs/fleet.md)",
    "no quorum": "Most of the hub's servers have to be up; try again in 10 s",
    "no responders": _NOT_SET_UP,
    "missing": _NOT_SET_UP,
    "too many": "Of recordings, name one robot: robotctl fleet recordings ROBOT",
    "full": "The hub has reached a limit; docs/fleet.md says how to make room",
}
_UNREACHABLE: Final = ("unreachable", "timeout", "no quorum")

HubOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--hub",
        metavar="SERVERS",
        help=f"A hub without authentication; ${HUB_VARIABLE} or the stored login's when left out.",
        show_default=False,
    ),
]


class HubUnreachableError(UserError):
    """The hub does not answer."""

    kind: ClassVar[str] = "unreachable"


class HubRefusalError(UserError):
    """The hub answers, and does not do what was requested."""

    kind: ClassVar[str] = "hub-refused"


@dataclass(frozen=True, slots=True)
class FleetSession:
    """One run.

    Args:
        login: How to reach the hub.
        as_json: Whether to print JSON instead of tables.
        out: Standard output.
    """

    login: FleetLogin
    as_json: bool
    out: Console

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["Hub"]:
        """Connects to the hub while the block runs.

        Raises:
            UserError: None of its servers answers within 5 s, or it refuses, also later on.
        """
        # The extra `fleet` may not be installed: `with_fleet` has found out.
        from fleet.connection import FleetAddress, connect  # noqa: PLC0415
        from fleet.errors import HubError  # noqa: PLC0415

        login = self.login
        address = FleetAddress(login.servers, login.credentials_file, login.ca_file, name="robotctl")
        try:
            async with connect(address) as hub:
                # A hub whose servers have all been tried once is not waited for.
                await hub.connected(ANSWERS_WITHIN_S, once=True)
                yield hub
        except HubError as error:
            kind = HubUnreachableError if error.reason.value in _UNREACHABLE else HubRefusalError
            code = ExitCode.UNREACHABLE if kind is HubUnreachableError else ExitCode.FAILED
            raise kind(str(error), _REMEDIES.get(error.reason.value, ""), exit_code=code) from error

    def show(self, document: Mapping[str, Any], view: RenderableType) -> None:
        """Prints the JSON document, or the view for people."""
        if self.as_json:
            print_json(self.out, document)
        else:
            self.out.print(view)


def with_fleet(function: Callable[..., None]) -> Callable[..., None]:
    """Returns the command of a function: with --hub and --json, which make its first argument.

    Args:
        function: Takes the `FleetSession`, and the command's own arguments and options by name.
    """

    @functools.wraps(function, assigned=("__module__", "__name__", "__qualname__", "__doc__"))
    def command(
        context: typer.Context, hub: HubOption = None, as_json: JsonOption = False, **own: Any
    ) -> None:
        servers = hub or os.environ.get(HUB_VARIABLE)
        login = login_of_servers(servers) if servers else read_fleet_login()
        _require_nats()
        function(FleetSession(login, json_requested(context, as_json), standard_output()), **own)

    take_parameters(command, function)
    return command


def _require_nats() -> None:
    try:
        importlib.import_module("fleet.connection")
    except ModuleNotFoundError as error:
        if error.name not in ("nats", "nkeys"):
            raise
        raise UserError(
            f"the fleet needs the package {error.name}, which is not installed", _INSTALL
        ) from error
