"""The connection to the gateway: streams whose messages are taken as they are on the wire.

The client library maps answers to values for people; what goes to the hub has to stay as the gateway issued
it. So this takes the library's connection (deadlines, keepalive, credentials, errors), and the schema's own
messages.
"""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from bridge.config import GatewaySettings
from bridge.events.values import Position
from common.errors import UserError
from common.reasons import Reason
from console.client.errors import NotAllowed, NotTrusted
from console.client.mapping.methods import Method, events_request, watch_request
from console.client.options import ClientOptions
from console.client.results import EventPosition, FaultSeverity
from console.client.transport import GrpcTransport, Responses
from console.credentials import Credentials
from console.robots.credentials import read_credentials, read_private
from console.robots.login import parse_login
from console.robots.robots_file import Robot
from console.target import parse_target

EVENTS: Final[Method[Any]] = Method("SubscribeEvents", lambda message: message)
STATUS: Final[Method[Any]] = Method("WatchSystemStatus", lambda message: message)
EVENTS_SILENT_S: Final = 7.0
"""The gateway's keepalive of 5 s, and an answer's deadline."""
STATUS_SILENT_S: Final = 3.0
"""The same for a status every second."""
_STATUS_INTERVAL_S: Final = 1.0
NEW_LOGIN: Final = (
    "Put a new login into gateway.login of the bridge's configuration; on the robot "
    "'robot-gateway credentials rotate NAME' prints one (docs/fleet.md), and no restart is needed"
)

_LOGIN_HELPS: Final = frozenset(
    {
        Reason.CREDENTIAL_MISSING,
        Reason.CREDENTIAL_UNKNOWN,
        Reason.CREDENTIAL_REVOKED,
        Reason.CREDENTIAL_EXPIRED,
        Reason.CREDENTIAL_NOT_YET_VALID,
    }
)


def credentials(settings: GatewaySettings) -> Credentials:
    """Returns the credentials, read now: they may have been replaced.

    Raises:
        UserError: a file is missing or open to others, or the login is none.
    """
    if settings.login:
        return _login(settings.login)
    return read_credentials(
        Robot(
            target=settings.target,
            ca_certificate_file=settings.ca_certificate_file,
            client_certificate_file=settings.client_certificate_file,
            client_key_file=settings.client_key_file,
            token_file=settings.token_file,
        )
    )


def remedy(error: UserError) -> str:
    """Returns what to do here about an error of the gateway.

    The client's own advice is for an operator's computer, where `robotctl login` stores a login.
    """
    login_helps = isinstance(error, NotTrusted) or (
        isinstance(error, NotAllowed) and error.reason in _LOGIN_HELPS
    )
    return NEW_LOGIN if login_helps else error.remedy


def explained(error: UserError) -> str:
    """Returns an error of the gateway as one line: what happened, and what to do here."""
    return str(UserError(error.what, remedy(error)))


def _login(path: Path) -> Credentials:
    """Returns the credentials of a login; raises as `credentials`."""
    try:
        text = read_private(path, "login")
        return parse_login(text.decode("utf-8", errors="replace")).credentials
    except UserError as error:
        # What is to be done on an operator's laptop is not what is to be done here.
        remedy = error.remedy if error.remedy.startswith("Type: chmod") else NEW_LOGIN
        what = error.what if str(path) in error.what else f"{path}: {error.what}"
        raise UserError(what, remedy, exit_code=error.exit_code) from error


@asynccontextmanager
async def events(settings: GatewaySettings, after: Position | None) -> AsyncIterator[Responses]:
    """Opens the stream of events after a position; None begins with the oldest that is kept.

    Raises:
        UserError: the credentials can't be read, or would be sent in the clear.
    """
    place = EventPosition(after.run_id, after.sequence) if after else None
    request = events_request(place, FaultSeverity.UNKNOWN)
    async with _stream(settings, EVENTS, request, newest_only=False) as responses:
        yield responses


@asynccontextmanager
async def statuses(settings: GatewaySettings) -> AsyncIterator[Responses]:
    """Opens the stream of statuses, at most one a second; raises as `events`."""
    request = watch_request(_STATUS_INTERVAL_S, include_detections=False)
    async with _stream(settings, STATUS, request, newest_only=True) as responses:
        yield responses


@asynccontextmanager
async def _stream(
    settings: GatewaySettings, method: Method[Any], request: bytes, *, newest_only: bool
) -> AsyncIterator[Responses]:
    target = parse_target(settings.target)
    transport = GrpcTransport(target, ClientOptions(), credentials(settings))
    try:
        responses = transport.open(method, request, newest_only=newest_only)
        try:
            yield responses
        finally:
            responses.cancel()
    finally:
        await transport.close()
