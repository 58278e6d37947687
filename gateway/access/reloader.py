"""Reloads credentials and certificates when their files change, without a restart or a signal.

What can't be read changes nothing at first: the last good version stays in effect, and operators see a fault.
A list of credentials that stays unreadable may hide a revocation, so that no credential is accepted any more.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NoReturn

from common.ca import KeyPair, certificate_info, is_issued_by
from common.errors import UserError
from gateway.access.command import credentials_command
from gateway.access.directory import CredentialDirectory, KeyPairFiles, read_authority
from gateway.access.store import Store
from gateway.status.access import AccessView, CertificateExpiry, UnreadFile

_log = logging.getLogger(__name__)

POLL_INTERVAL_S: Final = 0.25
"""Bounds how long a revoked credential remains usable. Its caller learns of it half a second later
(`REFUSAL_DELAY_S`), and all of that is promised within a second."""
_UNKNOWN_INTERVAL_S: Final = 0.1
"""Minimum interval of polls caused by unknown credentials, of which there may be a flood."""
UNKNOWN_WITHIN_S: Final = 2.0
"""How long a caller with an unknown credential waits for a poll."""
CLOSED_AFTER_S: Final = 60.0
"""How long the list of credentials may be unreadable before none is accepted."""
FAILURES_REPORTED: Final = 6
"""Consecutive failures before a fault, 1.5 s: two files that belong together do not change at the same
instant."""
_DISK_HANGS: Final = UnreadFile(
    "the list of credentials can't be read: the disk does not answer",
    "Check the disk of the list; to see its errors, type: sudo dmesg",
    is_list=True,
)
_CERTIFICATES: Final = {
    "server_certificate": ("the gateway's certificate", "server"),
    "authority": ("the robot's certificate authority", "ca"),
}
"""Certificates whose expiry is reported: text for people, and the argument of `rotate` that renews them."""


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """Files that TLS needs.

    Attributes:
        certificate: of the gateway.
        key: of that certificate.
        client_ca: certificate of the CA of client certificates; None requests no certificate from clients.
        issuer: certificate of the robot's CA, where it must have issued the gateway's; None where that is
            another one's.
    """

    certificate: Path
    key: Path
    client_ca: Path | None = None
    issuer: Path | None = None


@dataclass(frozen=True, slots=True)
class TlsMaterial:
    """Contents of `TlsFiles`."""

    server: KeyPair
    client_ca: bytes | None


@dataclass(frozen=True, slots=True)
class LoadedAccess:
    """Credentials and certificates that are in effect together.

    Attributes:
        store: the credentials.
        tls: None without TLS.
        ends_s: end of validity of certificates by their key in `_CERTIFICATES`, seconds since 1970.
        problem: why no credential is accepted; empty if they are.
    """

    store: Store
    tls: TlsMaterial | None
    ends_s: Mapping[str, int]
    problem: str = ""


def load_access(directory: CredentialDirectory, tls: TlsFiles | None) -> LoadedAccess:
    """Reads credentials and certificates.

    Raises:
        UserError: one can't be read or is invalid.
    """
    return _with_certificates(directory.read_store(), tls)


def _with_certificates(store: Store, tls: TlsFiles | None) -> LoadedAccess:
    if tls is None:
        return LoadedAccess(store, None, {})
    files = KeyPairFiles(tls.certificate, tls.key, "server certificate")
    server = files.read()
    if tls.issuer:
        _check_issuer(server.certificate, tls.certificate, tls.issuer)
    try:
        ends_s = {"server_certificate": certificate_info(server.certificate).ends_s}
    except ValueError as error:
        raise files.unparsed(error) from error
    client_ca = None
    if tls.client_ca:
        client_ca, info = read_authority(tls.client_ca, lambda pem: (pem, certificate_info(pem)))
        ends_s["authority"] = info.ends_s
    return LoadedAccess(store, TlsMaterial(server, client_ca), ends_s)


def _check_issuer(certificate: bytes, file: Path, authority: Path) -> None:
    """Raises a UserError if laptops, which know the robot's CA, would not trust the certificate.

    So it is after a crash in the middle of `rotate ca`, where each certificate has its key.
    """
    issued = read_authority(authority, lambda pem: is_issued_by(certificate, pem))
    if not issued:
        raise UserError(
            f"{file} was not issued by the certificate authority {authority}, so that no laptop trusts it",
            f"Type: {credentials_command('rotate server', authority.parent)}",
        )


class CredentialReloader:
    """Polls the files of credentials and certificates. Used on one event loop alone.

    Args:
        directory: of the credentials.
        tls: files of the certificates; None without TLS.
        on_change: called with each new version.

    Raises:
        UserError: the initial version can't be read.
    """

    def __init__(
        self,
        directory: CredentialDirectory,
        tls: TlsFiles | None,
        on_change: Callable[[LoadedAccess], None],
    ) -> None:
        self._directory = directory
        self._tls = tls
        self._files = [directory.store_file]
        if tls:
            self._files += [each for each in (tls.certificate, tls.key, tls.client_ca, tls.issuer) if each]
        self._on_change = on_change
        self._seen = self._signatures()
        self.loaded = load_access(directory, tls)
        self._unread: UnreadFile | None = None
        self._failures = 0
        self._unconfirmed_since_s: float | None = None
        """When the first attempt began that has not shown yet that the list in effect is the newest."""
        self._polling = asyncio.Lock()
        """Held by a poll: an earlier one that ended later would put a revoked credential back into effect."""
        self._polled_s = -math.inf
        self._next_poll: asyncio.Task[None] | None = None

    async def run(self) -> NoReturn:
        """Polls the files until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._keep_polling(), name="credential files")
            while True:
                # Apart from the polls: one on a disk that hangs does not end.
                await asyncio.sleep(POLL_INTERVAL_S)
                unread = self._unread
                self._close_if_overdue(unread if unread and unread.is_list else _DISK_HANGS)

    async def reload_for_unknown(self) -> None:
        """Returns after a poll that began after this call, because the credential may just have been added.

        Concurrent calls share polls, which are at least 0.1 s apart. Returns in any case after
        UNKNOWN_WITHIN_S: the disk may hang.
        """
        if self._next_poll is None:
            self._next_poll = asyncio.create_task(self._poll_when_due(), name="reload for unknown credential")
        # Does not cancel the poll, which is that of others, too.
        done, _ = await asyncio.wait((self._next_poll,), timeout=UNKNOWN_WITHIN_S)
        for each in done:
            each.result()

    def view(self, audit_error: str = "") -> AccessView:
        """Returns the state of access control that operators see."""
        now_s = time.time()
        return AccessView(
            tuple(
                _certificate_expiry(which, ends_s, now_s, self._directory.path)
                for which, ends_s in self.loaded.ends_s.items()
            ),
            self._unread,
            audit_error,
            closed=bool(self.loaded.problem),
        )

    async def _keep_polling(self) -> NoReturn:
        while True:
            await asyncio.sleep(POLL_INTERVAL_S)
            async with self._polling:
                await self._poll()

    async def _poll_when_due(self) -> None:
        await asyncio.sleep(max(0.0, self._polled_s + _UNKNOWN_INTERVAL_S - time.monotonic()))
        async with self._polling:
            # Not before: while the earlier poll hangs, all later callers share this one.
            self._next_poll = None
            await self._poll()

    async def _poll(self) -> None:
        """Polls once; `_polling` is held."""
        self._polled_s = time.monotonic()
        if self._unconfirmed_since_s is None:
            self._unconfirmed_since_s = self._polled_s
        if await self._reload_if_changed():
            self._unconfirmed_since_s = None

    async def _reload_if_changed(self) -> bool:
        """Returns whether the list of credentials could be read."""
        # Files are read in a worker thread, because a disk may be slow.
        seen = await asyncio.to_thread(self._signatures)
        if seen == self._seen and not self._failures and not self.loaded.problem:
            return True
        try:
            store = await asyncio.to_thread(self._directory.read_store)
        except UserError as error:
            unread = UnreadFile(error.what, error.remedy, is_list=True)
            self._note(unread)
            self._close_if_overdue(unread)
            return False
        try:
            loaded = await asyncio.to_thread(_with_certificates, store, self._tls)
        except UserError as error:
            self._note(UnreadFile(error.what, error.remedy, is_list=False))
            # A certificate that can't be read must not keep a revocation from taking effect.
            self._put_in_effect(replace(self.loaded, store=store, problem=""))
            return True
        self._seen, self._unread, self._failures = seen, None, 0
        self._put_in_effect(loaded)
        return True

    def _note(self, unread: UnreadFile) -> None:
        self._failures += 1
        # One that has been reported is outdated by whatever is found now.
        if self._failures >= FAILURES_REPORTED or self._unread:
            self._report(unread)

    def _report(self, unread: UnreadFile) -> None:
        if unread != self._unread:
            _log.error("access: %s", UserError(unread.why, unread.remedy))
        self._unread = unread

    def _close_if_overdue(self, unread: UnreadFile) -> None:
        since_s = self._unconfirmed_since_s
        if since_s is not None and time.monotonic() - since_s >= CLOSED_AFTER_S and not self.loaded.problem:
            self._report(unread)
            self._put_in_effect(replace(self.loaded, problem=unread.why))

    def _put_in_effect(self, loaded: LoadedAccess) -> None:
        if loaded != self.loaded:
            self.loaded = loaded
            self._on_change(loaded)

    def _signatures(self) -> tuple[tuple[int, ...], ...]:
        return tuple(_signature(path) for path in self._files)


def _signature(path: Path) -> tuple[int, ...]:
    """Returns what changes when the file is replaced or edited, or the errno if it can't be examined."""
    try:
        status = path.stat()
    except OSError as error:
        return (error.errno or -1,)
    return status.st_mtime_ns, status.st_size, status.st_ino, status.st_mode


def _certificate_expiry(which: str, ends_s: int, now_s: float, directory: Path) -> CertificateExpiry:
    name, argument = _CERTIFICATES[which]
    return CertificateExpiry(
        key=which,
        name=name,
        ends_on=datetime.fromtimestamp(ends_s, UTC).date().isoformat(),
        left_s=ends_s - now_s,
        remedy=f"On the robot: {credentials_command(f'rotate {argument}', directory)}",
    )
