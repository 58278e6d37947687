"""The gateway's door: put together from the settings, guarded or not."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import grpc

from common import request_id
from gateway.access.audit import AuditLog, AuditRecord
from gateway.access.directory import CredentialDirectory
from gateway.access.keyring import Keyring
from gateway.access.lockout import Lockout
from gateway.access.watch import AccessWatch, Loaded, TlsFiles
from gateway.config import SecuritySettings
from gateway.rpc.controls import action_news
from gateway.rpc.guard import Guard
from gateway.rpc.identity import caller
from gateway.rpc.tls import ServerTls
from gateway.status.access import AccessView
from gateway.status.event import ControlAction, ControlResult, News

_KIB: Final = 1024
_AUDIT_FILE: Final = "audit.jsonl"


class Door:
    """Belongs to one event loop.

    Args:
        settings: who may call, and how.
        tell: takes the news of control actions that were refused here.
        somebody_is_out: called when one who was let in would not be any more.

    Raises:
        UserError: credentials or certificates can't be read.
    """

    def __init__(
        self,
        settings: SecuritySettings,
        tell: Callable[[News], None],
        somebody_is_out: Callable[[], None],
    ) -> None:
        self._tell = tell
        where = settings.credentials
        file = settings.audit.file or (where / _AUDIT_FILE if where else None)
        self._audit = AuditLog(file, settings.audit.max_kib * _KIB, settings.audit.generations)
        self.guard: Guard | None = None
        self._watch: AccessWatch | None = None
        self._tls: ServerTls | None = None
        if where is None:
            return
        files = CredentialDirectory(where)
        tls_files = tls_files_of(settings, files)
        self._watch = watch = AccessWatch(files.read_store, files.store_file, tls_files, self._take_over)
        self._keyring = Keyring(watch.loaded.store)
        asked = tls_files is not None and tls_files.client_authority is not None
        self.guard = Guard(
            self._keyring,
            Lockout(),
            self._note_refused,
            watch.look_for_unknown,
            somebody_is_out,
            certificates=asked,
        )
        self._tls = ServerTls(watch.loaded.tls) if watch.loaded.tls else None

    def credentials(self) -> grpc.ServerCredentials | None:
        """What the server encrypts with; None for plaintext."""
        return self._tls.credentials() if self._tls else None

    def view(self) -> AccessView:
        """How the door is doing."""
        trouble = self._audit.trouble
        return self._watch.view(trouble) if self._watch else AccessView(audit_error=trouble)

    def note(self, action: ControlAction) -> None:
        """Takes a control action into the audit log; to be called while the call is served."""
        by = caller()
        self._audit.note(
            AuditRecord(
                who=by.name if by else "",
                role=by.role.value if by else "",
                credential=by.credential_ids[0] if by else "",
                address=action.address,
                action=action.method,
                request=action.request,
                result=action.result.value,
                answer=action.answer,
                request_id=request_id.current(),
            )
        )

    def _note_refused(self, record: AuditRecord) -> None:
        self._audit.note(record)
        action = ControlAction(
            who=record.who,
            address=record.address,
            method=record.action,
            request=record.request,
            result=ControlResult.REFUSED,
            answer=record.answer,
        )
        self._tell(action_news(action))

    @contextmanager
    def recording(self) -> Iterator[None]:
        """The audit log is written while the block lasts."""
        with self._audit.writing():
            yield

    async def run(self) -> None:
        """Keeps the credentials in force the newest ones, until cancelled."""
        if self._watch is None or self.guard is None:
            return
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch.run(), name="credentials")
            tasks.create_task(self.guard.run(), name="streams")

    def _take_over(self, loaded: Loaded) -> None:
        self._keyring.use(loaded.store)
        if self._tls and loaded.tls:
            self._tls.use(loaded.tls)
        self._audit.note(_changed_note(len(loaded.store.credentials)))


def read_access(settings: SecuritySettings, where: Path) -> Loaded:
    """Everything by which callers are asked who they are, read as a gateway does that starts.

    Args:
        settings: who may call, and how.
        where: the directory of the credentials.

    Raises:
        UserError: credentials or certificates can't be read.
    """
    files = CredentialDirectory(where)
    return AccessWatch(files.read_store, files.store_file, tls_files_of(settings, files)).loaded


def tls_files_of(settings: SecuritySettings, files: CredentialDirectory) -> TlsFiles | None:
    """Where the certificates are: those of the settings, or those that the directory has."""
    tls = settings.tls
    if not tls.enabled:
        return None
    certificate, key = files.server_files
    authority = (tls.client_ca or files.authority_files[0]) if tls.client_certificates else None
    return TlsFiles(tls.certificate or certificate, tls.key or key, authority)


def _changed_note(count: int) -> AuditRecord:
    return AuditRecord(
        who="",
        role="",
        credential="",
        address="this robot",
        action="credentials",
        request="changed files",
        result="accepted",
        answer=f"{count} credentials and the newest certificates are in force",
        request_id="",
    )
