"""Who may call: credentials, certificates and the audit log, put together from the settings."""

import asyncio
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import grpc

from gateway.access.audit import AuditLog
from gateway.access.authenticator import Authenticator
from gateway.access.lockout import Lockout
from gateway.access.reloader import CredentialReloader, LoadedAccess
from gateway.config import SecuritySettings
from gateway.rpc.calls.ports import EventSink, StreamKey
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.refusal_delay import RefusalDelay
from gateway.rpc.interceptors.audit import Audit
from gateway.rpc.interceptors.auth import Auth
from gateway.rpc.tls import ServerTls
from gateway.status.access import AccessView
from gateway.status.event import ControlAction, ControlResult

_log = logging.getLogger(__name__)

_KIB: Final = 1024
_AUDIT_FILE: Final = "audit.jsonl"
_MOST_NAMED: Final = 16
"""Changed credentials that one record of the audit log names."""


class AccessControl:
    """Authentication, authorization and accounting of the operators' calls.

    Args:
        settings: who may call, and how.
        events: where refused control actions are shown.
        stream_key: renewed when a caller loses access.
        admission: gives connections their places.
        refusals: delays the refusals of others.

    Attributes:
        audit: the interceptor that records control actions.
        auth: the interceptor that authenticates; None where callers are not.

    Raises:
        UserError: credentials or certificates can't be read.
    """

    def __init__(
        self,
        settings: SecuritySettings,
        events: EventSink,
        stream_key: StreamKey,
        admission: Admission,
        refusals: RefusalDelay,
    ) -> None:
        directory = settings.credentials
        file = settings.audit.file or (directory / _AUDIT_FILE if directory else None)
        refused_file = file.with_name(f"{file.stem}-refused{file.suffix}") if file else None
        limits = settings.audit.max_kib * _KIB, settings.audit.generations
        self._done_log, self._refused_log = AuditLog(file, *limits), AuditLog(refused_file, *limits)
        self.audit = Audit(events, self._done_log, self._refused_log)
        self.auth: Auth | None = None
        self._reloader: CredentialReloader | None = None
        self._tls: ServerTls | None = None
        access_files = settings.access_files()
        if access_files is None:
            return
        files, tls_files = access_files
        self._reloader = CredentialReloader(files, tls_files, self._use)
        self._loaded = self._reloader.loaded
        self._authenticator = Authenticator(self._loaded.store)
        certificates = tls_files is not None and tls_files.client_ca is not None
        self.auth = Auth(
            self._authenticator,
            Lockout(),
            self._reloader,
            stream_key,
            admission=admission,
            refusals=refusals,
            certificates=certificates,
        )
        if self._reloader.loaded.tls:
            self._tls = ServerTls(self._reloader.loaded.tls)

    @property
    def server_credentials(self) -> grpc.ServerCredentials | None:
        """For TLS; None for plaintext."""
        return self._tls.credentials() if self._tls else None

    def view(self) -> AccessView:
        """Returns the state of credentials, certificates and audit log, for the fault rules."""
        error = self._done_log.error or self._refused_log.error
        return self._reloader.view(error) if self._reloader else AccessView(audit_error=error)

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Writes the audit log while the block lasts."""
        with self._done_log.writing(), self._refused_log.writing():
            try:
                yield
            finally:
                self.audit.record_all()

    async def run(self) -> None:
        """Follows changes of the credential files, until cancelled."""
        if self._reloader is None or self.auth is None:
            return
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._reloader.run(), name="credentials")
            tasks.create_task(self.auth.run(), name="revocation")

    def _use(self, loaded: LoadedAccess) -> None:
        self._authenticator.use(loaded.store, loaded.problem)
        if self.auth:
            self.auth.end_revoked()
        if self._tls and loaded.tls:
            self._tls.use(loaded.tls)
        changes = ", ".join(_changes(self._loaded, loaded))
        answer = f"{changes}; {len(loaded.store.credentials)} credentials are listed"
        self._loaded = loaded
        if loaded.problem:
            answer = f"no credential is accepted: {loaded.problem}"
            _log.error("access: %s", answer)
        self._done_log.record(
            ControlAction(
                who="",
                address="this robot",
                method="credentials",
                request="changed files",
                result=ControlResult.FAILED if loaded.problem else ControlResult.ACCEPTED,
                answer=answer,
            )
        )


def _changes(before: LoadedAccess, loaded: LoadedAccess) -> list[str]:
    """Returns what differs in two versions, for the audit log."""
    changes = list(loaded.store.changes_since(before.store))
    if more := changes[_MOST_NAMED:]:
        changes[_MOST_NAMED:] = [f"and {len(more)} more"]
    if loaded.tls != before.tls:
        changes.append("certificates were exchanged")
    if before.problem and not loaded.problem:
        changes.append("credentials are accepted again")
    return changes
