"""The operator's server: every method of the contract and every interceptor, in order."""

import logging
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final

import grpc
from grpc_health.v1.health import SERVICE_NAME as HEALTH_SERVICE
from grpc_reflection.v1alpha.reflection import SERVICE_NAME as REFLECTION_SERVICE
from grpc_reflection.v1alpha.reflection import enable_server_reflection

from common.addresses import bracketed
from common.bind import bind_tcp, bind_unix
from common.grpc_errors import ErrorInterceptor
from common.health import Health
from common.interceptors import Behavior, Chain
from common.rpc import STOP_GRACE_S, new_server
from gateway.config import GrpcSettings
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import CONTRACT, SERVICES, Method
from gateway.rpc.interceptors.audit import Audit, AuditStart
from gateway.rpc.interceptors.auth import Auth, Authorization
from gateway.rpc.interceptors.caller_limit import CallerLimit
from gateway.rpc.interceptors.exemption import Exemption
from gateway.rpc.interceptors.presence import Presence
from gateway.rpc.interceptors.rate_limit import RateLimit
from gateway.rpc.interceptors.room import MAX_OPEN, Room
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.interceptors.turns import TurnEnd, Turns
from gateway.rpc.interceptors.validation import Validation
from gateway.rpc.services.events import EventsService
from gateway.rpc.services.info import InfoService
from gateway.rpc.services.preview import PreviewService
from gateway.rpc.services.recording import RecordingService
from gateway.rpc.services.status import StatusService
from gateway.rpc.services.teleop import TeleopService

_log = logging.getLogger(__name__)

SERVICE: Final = CONTRACT.full_name
_MAX_CALLS: Final = 2 * MAX_OPEN
"""That gRPC serves at once: stops find room beyond MAX_OPEN, and those that are refused there end at once."""


@dataclass(frozen=True, slots=True)
class Services:
    """One servicer per resource."""

    status: StatusService
    preview: PreviewService
    events: EventsService
    info: InfoService
    teleop: TeleopService
    recording: RecordingService

    def methods(self) -> Mapping[str, Behavior]:
        """Returns the contract's methods by name. Total: a test compares them with the schema."""
        return {
            "GetSystemStatus": self.status.get_system_status,
            "GetOverlaySnapshot": self.status.get_overlay_snapshot,
            "WatchSystemStatus": self.status.watch_system_status,
            "SetPreviewMode": self.preview.set_preview_mode,
            "RequestKeyFrame": self.preview.request_key_frame,
            "ReportPicture": self.preview.report_picture,
            "SubscribeEvents": self.events.subscribe_events,
            "GetGatewayInfo": self.info.get_gateway_info,
            "Ping": self.info.ping,
            "SetTeleopEnabled": self.teleop.set_teleop_enabled,
            "SendTeleopCommand": self.teleop.send_teleop_command,
            "Drive": self.teleop.drive,
            "StopRobot": self.teleop.stop_robot,
            "ResetStop": self.teleop.reset_stop,
            "StartRecording": self.recording.start_recording,
            "StopRecording": self.recording.stop_recording,
            "TriggerSnapshot": self.recording.trigger_snapshot,
            "ListRecordings": self.recording.list_recordings,
            "GetRecording": self.recording.get_recording,
            "ExportRecording": self.recording.export_recording,
            "GetRecordingThumbnail": self.recording.get_recording_thumbnail,
            "PinRecording": self.recording.pin_recording,
            "DeleteRecording": self.recording.delete_recording,
            "UploadRecording": self.recording.upload_recording,
            "CancelUpload": self.recording.cancel_upload,
        }


@dataclass(frozen=True, slots=True)
class Interceptors:
    """What every call passes; `auth` is None where callers are not authenticated."""

    stats: Stats
    turns: Turns
    rate_limit: RateLimit
    audit: Audit
    caller_limit: CallerLimit
    auth: Auth | None
    validation: Validation
    presence: Presence

    def chain(self) -> Chain:
        """Returns them in their order, outermost first."""
        return Chain(
            [
                ErrorInterceptor(),  # turns what any of the others raises into a status
                self.stats,  # counts what the others refuse, too
                *([Exemption(self.auth)] if self.auth else []),  # before any limit
                self.turns,  # before a stranger's call costs anything
                Room(),  # of which a stop needs none
                self.rate_limit,  # before any call costs anything
                self.audit,  # records what those further in refuse
                *([self.auth] if self.auth else []),
                self.caller_limit,  # what all connections of that caller share
                *([Authorization(self.auth)] if self.auth else []),  # whose refusals are of that share
                TurnEnd(self.turns),  # once it is known who calls, and that it may
                self.validation,
                AuditStart(self.audit),  # records valid requests alone
                self.presence,  # sees admitted calls alone
            ],
            Method,
            CallContext,
        )


@asynccontextmanager
async def serving(
    settings: GrpcSettings,
    services: Services,
    interceptors: Interceptors,
    health: Health,
    *,
    max_connections: int,
    credentials: grpc.ServerCredentials | None = None,
    extra: Sequence[grpc.GenericRpcHandler] = (),
) -> AsyncIterator[int]:
    """Serves operators until the block ends; running calls then get STOP_GRACE_S to finish.

    Args:
        settings: where to listen.
        services: answer the contract's methods.
        interceptors: what every call passes.
        health: answers the health service.
        max_connections: accepted at once.
        credentials: for TLS; None for plaintext.
        extra: further services.

    Yields:
        The TCP port.

    Raises:
        UserError: an address can't be bound.
    """
    chain = interceptors.chain()
    server = new_server(
        chain,
        max_connections=max_connections,
        max_calls=_MAX_CALLS,
    )
    methods = services.methods()
    handlers = [
        chain.service(each, {name: methods[name] for name in each.methods_by_name}) for each in SERVICES
    ]
    server.add_generic_rpc_handlers((*handlers, *extra))
    health.register(server)
    names = [each.full_name for each in SERVICES]
    enable_server_reflection((*names, HEALTH_SERVICE, REFLECTION_SERVICE), server)
    try:
        try:
            # The port last: of a server that is stopped, gRPC may keep it for 20 s.
            if settings.socket:
                bind_unix(server, settings.socket)
            port = bind_tcp(server, settings.host, settings.port, credentials)
        finally:
            # After a failure, too: gRPC gives the ports of a server back only if it was started.
            await server.start()
        _log.info(
            "serving operators at %s:%d (%s, %s)",
            bracketed(settings.host),
            port,
            "plaintext" if credentials is None else "TLS",
            "callers are not authenticated" if interceptors.auth is None else "callers need a credential",
        )
        yield port
    finally:
        await server.stop(STOP_GRACE_S)
