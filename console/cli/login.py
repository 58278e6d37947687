"""robotctl login: stores a login for a robot, after the robot has accepted it."""

import shlex
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, TypeVar

import typer

from common.backoff import Backoff
from common.errors import ExitCode, UserError
from common.reasons import Reason
from console.cli.options import JsonOption, json_requested
from console.cli.piped_login import HasLoginError, PipedLogin
from console.cli.session import print_json, standard_output
from console.client import Credentials, GatewayClient, NotAllowed
from console.robots import read_credentials, read_robots_file
from console.robots.credentials import read_public
from console.robots.login import keep_login, parse_login
from console.robots.robots_file import FILE_KEYS, check_name
from console.target import parse_target

AnswerT = TypeVar("AnswerT")

STANDARD_INPUT = "-"
_FIRST_PAUSE_S: Final = 0.25
_LONGEST_PAUSE_S: Final = 1.0
_RETRIES: Final = 3


def login(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="ROBOT", help="Name to store it under; --robot selects it.")],
    target: Annotated[str, typer.Argument(metavar="HOST:PORT", help="Address of its gateway.")],
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="File with the login; - is standard input.")
    ] = STANDARD_INPUT,
    *,
    ca: Annotated[Path | None, typer.Option(help="Replace the robot's CA certificate only (PEM).")] = None,
    offline: Annotated[
        bool, typer.Option("--offline", help="Store it without contacting the robot.", show_default=False)
    ] = False,
    replacing: Annotated[
        bool,
        typer.Option("--replace", help="Store it over the robot's present login.", show_default=False),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Store a login issued by the robot's administrator, for all later commands.

    On one line: ssh HOST robot-gateway credentials add NAME --role operator | robotctl login ROBOT HOST:PORT
    """
    piped = PipedLogin.of(sys.stdin) if not ca and file == STANDARD_INPUT else None
    with piped.accounted_for() if piped else nullcontext():
        check_name(name)
        target = parse_target(target)
        if not (replacing or ca):
            _check_free(name)
        text = "" if ca else login_text(file)
        if piped:
            piped.text = text
        user, credentials = _with_new_authority(name, ca) if ca else _read(text)
        gateway_name = ""
        if not offline:
            with GatewayClient(target, credentials=credentials) as gateway:
                gateway_name = once_known(gateway.status).gateway_name
        known = keep_login(name, target, credentials)
    out = standard_output()
    if json_requested(context, as_json):
        print_json(out, {"robot": name, "target": target, "who": user, "gateway_name": gateway_name})
        return
    result = f"{gateway_name} accepts you" if gateway_name else "not asked"
    as_user = f" as {user}" if user else ""
    out.print(f"{name} at {target}: {result}{as_user}. Stored in {known.path.parent}.")
    out.print(f"Type: robotctl --robot {name} status")


def once_known(ask: Callable[[], AnswerT], sleep: Callable[[float], None] = time.sleep) -> AnswerT:
    """Returns the answer to a new login, which the gateway may not have read from its list yet.

    A login that the robot does not know is shown again within 2 s, less often than locks its address out.

    Args:
        ask: Any call.
        sleep: Waits for so many seconds.

    Raises:
        GatewayError: Of the last call.
    """
    pauses = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
    while True:
        try:
            return ask()
        except NotAllowed as error:
            if error.reason != Reason.CREDENTIAL_UNKNOWN or pauses.failures == _RETRIES:
                raise
        sleep(pauses.next_s())


def _check_free(name: str) -> None:
    known = read_robots_file().robots.get(name)
    if known and any(getattr(known, key) for key in FILE_KEYS):
        raise HasLoginError(
            f"'{name}' has a login already, at {known.target}",
            f"Type: {shlex.join(['robotctl', *sys.argv[1:], '--replace'])}",
            exit_code=ExitCode.USAGE,
        )


def login_text(file: str) -> str:
    """Returns the content of a file with a login.

    Args:
        file: Its name; "-" is standard input.

    Raises:
        UserError: It can't be read, or is not text.
    """
    try:
        return sys.stdin.read() if file == STANDARD_INPUT else Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise UserError(f"{file} can't be read: {reason}", exit_code=ExitCode.USAGE) from error


def _read(text: str) -> tuple[str, Credentials]:
    login = parse_login(text)
    return ", ".join(word for word in (login.name, login.role) if word), login.credentials


def _with_new_authority(name: str, ca: Path) -> tuple[str, Credentials]:
    known = read_credentials(read_robots_file().find(name))
    return "", replace(known, ca_certificate=read_public(ca, "CA certificate file"))
