"""Keeps the credentials in force the newest ones: looks at their files, and takes over what has changed.

No restart and no signal is needed, and none can be forgotten. What can't be read changes nothing: those that
were read last stay in force, and the operators see a fault.
"""

import asyncio
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NoReturn

from common.errors import UserError
from gateway.access.authority import Pair, belongs_together, certificate_facts
from gateway.access.command import to_type
from gateway.access.directory import read_pair, read_plain
from gateway.access.store import Store
from gateway.status.access import AccessView, CertificateExpiry

LOOK_EVERY_S: Final = 0.5
"""How often the files are looked at; a revoked credential is worth nothing a moment later."""
_UNKNOWN_LOOK_EVERY_S: Final = 0.1
"""Minimum interval of the looks that unknown credentials cause: a flood of them costs ten `stat` a second."""
_TROUBLED_LOOKS: Final = 3
"""Two files that belong together don't change at one instant: so many looks may find them apart."""
_ENDING: Final = {
    "server_certificate": ("the gateway's certificate", "server"),
    "authority": ("the robot's certificate authority", "ca"),
}
"""Certificates whose end concerns everybody: what people call them, and what renews them."""


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """What TLS needs.

    Attributes:
        certificate: what the gateway shows.
        key: the certificate's.
        client_authority: who signs clients' certificates; None asks for no certificate.
    """

    certificate: Path
    key: Path
    client_authority: Path | None = None


@dataclass(frozen=True, slots=True)
class TlsMaterial:
    """The same, read."""

    server: Pair
    client_authority: bytes | None


@dataclass(frozen=True, slots=True)
class Loaded:
    """Everything that is in force together."""

    store: Store
    tls: TlsMaterial | None
    ends_s: Mapping[str, int]
    """When each of _ENDING is over, seconds since 1970; those alone that there are."""


class AccessWatch:
    """Belongs to one event loop.

    Args:
        read_store: reads who may call.
        store_file: what is looked at to see whether that has changed.
        tls: where the certificates are; None without TLS.
        on_change: takes over what has changed.
        clock: the calendar clock.

    Raises:
        UserError: something can't be read now, at the start.
    """

    def __init__(
        self,
        read_store: Callable[[], Store],
        store_file: Path,
        tls: TlsFiles | None,
        on_change: Callable[[Loaded], None] = lambda _: None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._read_store = read_store
        self._tls = tls
        self._files = [store_file, *(_files(tls) if tls else ())]
        self._clock = clock
        self.on_change = on_change
        self._seen = self._signature()
        self.loaded = self._load()
        self._trouble, self._troubled_looks = "", 0
        self._looking = asyncio.Lock()
        self._looked_s = -math.inf
        self._next_look: asyncio.Task[None] | None = None

    async def run(self) -> NoReturn:
        """Looks again and again, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            await self.look()

    async def look_for_unknown(self) -> None:
        """Returns after a look that began after this call: the credential may have been added just now.

        Calls share looks, which are at least `_UNKNOWN_LOOK_EVERY_S` apart.
        """
        if self._next_look is None:
            self._next_look = asyncio.create_task(self._look_when_due(), name="look for unknown credential")
        await asyncio.shield(self._next_look)

    async def _look_when_due(self) -> None:
        await asyncio.sleep(max(0.0, self._looked_s + _UNKNOWN_LOOK_EVERY_S - time.monotonic()))
        self._next_look = None
        await self.look()

    async def look(self) -> None:
        """One look. Files are read in another thread: a disk may be slow."""
        # One at a time: an older look that ended later would put a revoked credential back in force.
        async with self._looking:
            self._looked_s = time.monotonic()
            await self._look()

    async def _look(self) -> None:
        seen = await asyncio.to_thread(self._signature)
        if seen == self._seen and not self._troubled_looks:
            return
        try:
            loaded = await asyncio.to_thread(self._load)
        except UserError as error:
            self._troubled_looks += 1
            if self._troubled_looks >= _TROUBLED_LOOKS:
                self._trouble = error.what
            return
        self._seen, self._trouble, self._troubled_looks = seen, "", 0
        if loaded != self.loaded:
            self.loaded = loaded
            self.on_change(loaded)

    def view(self, audit_trouble: str = "") -> AccessView:
        """As the operators see it."""
        now_s = self._clock()
        return AccessView(
            tuple(_ending(which, ends_s, now_s) for which, ends_s in self.loaded.ends_s.items()),
            self._trouble,
            audit_trouble,
        )

    def _signature(self) -> tuple[tuple[int, ...], ...]:
        return tuple(_signature(path) for path in self._files)

    def _load(self) -> Loaded:
        store = self._read_store()
        if self._tls is None:
            return Loaded(store, None, {})
        return Loaded(store, *_material(self._tls))


def _files(tls: TlsFiles) -> tuple[Path, ...]:
    authority = (tls.client_authority,) if tls.client_authority else ()
    return (tls.certificate, tls.key, *authority)


def _signature(path: Path) -> tuple[int, ...]:
    try:
        status = path.stat()
    except OSError as error:
        return (error.errno or -1,)
    return status.st_mtime_ns, status.st_size, status.st_ino, status.st_mode


def _material(tls: TlsFiles) -> tuple[TlsMaterial, dict[str, int]]:
    """What TLS needs, and when it ends."""
    server = read_pair(tls.certificate, tls.key, "server certificate")
    authority = read_plain(tls.client_authority, "certificate authority") if tls.client_authority else None
    try:
        matches = belongs_together(server)
        ends_s = {"server_certificate": certificate_facts(server.certificate).ends_s}
        if authority:
            ends_s["authority"] = certificate_facts(authority).ends_s
    except ValueError as error:
        raise UserError(
            f"a certificate or key of {tls.certificate} can't be understood: {error}", "Both must be PEM"
        ) from error
    if not matches:
        raise UserError(
            f"{tls.key} is not the key of {tls.certificate}",
            f"Type: {to_type('rotate server')}",
        )
    return TlsMaterial(server, authority), ends_s


def _ending(which: str, ends_s: int, now_s: float) -> CertificateExpiry:
    words, rotate = _ENDING[which]
    return CertificateExpiry(
        key=which,
        name=words,
        ends_on=datetime.fromtimestamp(ends_s, UTC).date().isoformat(),
        left_s=ends_s - now_s,
        remedy=f"On the robot: {to_type(f'rotate {rotate}')}",
    )
