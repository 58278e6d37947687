"""Makes snapshots and incidents of the ring: recordings of some seconds before an instant, and some after."""

import asyncio
import logging
import time
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from common.errors import InvalidRequestError, PreconditionError, TooMuchError
from common.reasons import Reason
from recorder.config import RecorderSettings
from recorder.recording.incidents import SEVERITIES, Incidents, Rules
from recorder.recording.outputs import Outputs
from recorder.store.catalogue import Catalogue
from recorder.store.folder import new_id
from recorder.store.housekeeping import LEAST_ROOM, Housekeeping, attempt
from recorder.store.manifest import Kind, Manifest, RecordingState, StopReason
from recorder.store.outages import Outages
from recorder.store.ring import Ring, RingSegment, link_next
from recorder.store.salvage import ended
from recorder.values import Gap, GapCause

_log = logging.getLogger(__name__)

MAX_SNAPSHOTS: Final = 16
_LONGEST_TRIGGER: Final = 1000
_NS_PER_S: Final = 1_000_000_000
_NS_PER_MS: Final = 1_000_000


@dataclass(slots=True)
class _Snapshot:
    """A snapshot that is being made; instants of CLOCK_MONOTONIC in ns.

    Attributes:
        first_ns: of its first message; None while it has none.
    """

    id: str
    kind: Kind
    from_ns: int
    until_ns: int
    first_ns: int | None = None

    def takes(self, segment: RingSegment) -> None:
        """Takes note of a segment that it has."""
        firsts = [each for each in (self.first_ns, segment.first_message_ns) if each is not None]
        self.first_ns = min(firsts, default=None)


class Snapshots:
    """The snapshots and incidents of a ring.

    Args:
        settings: of the program; `ring.preset` is set.
        ring: its segments.
        catalogue: where snapshots become recordings.
        outputs: has the ring's, but while it can't be written.
        outages: of the ring.
        housekeeping: makes room.
        boot_id: of the computer; empty if unknown.
        run_id: of this process.
    """

    def __init__(
        self,
        settings: RecorderSettings,
        ring: Ring,
        catalogue: Catalogue,
        outputs: Outputs,
        outages: Outages,
        *,
        housekeeping: Housekeeping,
        boot_id: str,
        run_id: str,
    ) -> None:
        self._settings = settings
        self._preset = settings.ring.preset or ""
        self._ring = ring
        self._catalogue = catalogue
        self._outputs = outputs
        self._outages = outages
        self._housekeeping = housekeeping
        self._boot_id = boot_id
        self._run_id = run_id
        self._pending: list[_Snapshot] = []
        incidents = settings.incidents
        self._incidents = Incidents(
            Rules(
                incidents.enabled,
                SEVERITIES[incidents.min_severity],
                incidents.cooldown_s,
                frozenset(incidents.ignore),
            )
        )

    @property
    def pending(self) -> int:
        """Snapshots that are being made."""
        return len(self._pending)

    @property
    def next_due_s(self) -> float | None:
        """How long until the next snapshot has its end; None without one."""
        dues = [each.until_ns for each in self._pending]
        return (min(dues) - time.monotonic_ns()) / _NS_PER_S if dues else None

    def due(self, recording_id: str = "", *, all_of_them: bool = False) -> list[str]:
        """Returns the snapshots that have their end; with an ID that one, whether it has or not."""
        now_ns = time.monotonic_ns()
        return [
            each.id
            for each in self._pending
            if all_of_them or each.id == recording_id or (not recording_id and each.until_ns <= now_ns)
        ]

    async def make(
        self, kind: Kind, pre_s: int, post_s: int, *, label: str = "", preset: str = "", trigger: str = ""
    ) -> Manifest:
        """Keeps what the ring holds of the seconds before, and waits for those after.

        Raises:
            InvalidRequestError: the ring does not record this preset.
            PreconditionError: the ring can't be written at present.
            TooMuchError: the disk has no room, or 16 are being made.
        """
        if preset and preset != self._preset:
            raise InvalidRequestError(f"the ring records '{self._preset}', not '{preset}'")
        if self._outputs.ring is None:
            raise PreconditionError(
                "the ring can't be written at present; see last_error", Reason.RECORDER_NOT_READY
            )
        if len(self._pending) >= MAX_SNAPSHOTS:
            raise TooMuchError(f"{MAX_SNAPSHOTS} snapshots are being made", Reason.TOO_MANY_SNAPSHOTS)
        await self._housekeeping.need_room()
        now_ns, calendar_ns = time.monotonic_ns(), time.time_ns()
        pre_ns, post_ns = pre_s * _NS_PER_S, post_s * _NS_PER_S
        manifest = Manifest(
            id=new_id(calendar_ns / _NS_PER_S),
            ordinal=self._catalogue.next_ordinal,
            label=label,
            kind=kind,
            state=RecordingState.RECORDING,
            preset=self._preset,
            with_video=self._settings.records_video(self._preset),
            started_unix_ms=max(calendar_ns - pre_ns, 0) // _NS_PER_MS,
            started_monotonic_ns=max(now_ns - pre_ns, 0),
            boot_id=self._boot_id,
            run_id=self._run_id,
            trigger=trigger[:_LONGEST_TRIGGER],
            window_ns=(calendar_ns - pre_ns, calendar_ns + post_ns),
        )
        segments = self._ring.within(now_ns - pre_ns, now_ns + post_ns)
        try:
            made = await asyncio.to_thread(self._begun, manifest, segments)
        except OSError as error:
            raise TooMuchError(
                f"the disk refuses the snapshot: {error.strerror}", Reason.DISK_FULL
            ) from error
        snapshot = _Snapshot(made.id, kind, now_ns - pre_ns, now_ns + post_ns)
        for each in segments:
            snapshot.takes(each)
        self._pending.append(snapshot)
        # The files that it has stay: the ring needs as much room once more.
        await self._housekeeping.make_room(LEAST_ROOM)
        _log.info("%s %s is being made: %s", kind, made.id, trigger or "requested")
        return made

    async def report_fault(self, fault_id: str, severity: int, message: str) -> str:
        """Makes an incident of a fault, or merges it with one that is being made; returns its ID.

        Returns "" if the rules want none.

        Raises:
            PreconditionError: the ring can't be written at present.
            TooMuchError: the disk has no room, or 16 snapshots are being made.
        """
        if not self._incidents.wanted(fault_id, severity):
            return ""
        now_s = time.monotonic()
        pending = [each for each in self._pending if each.kind is Kind.INCIDENT]
        if earlier := self._incidents.earlier(fault_id, now_s, [each.id for each in pending]):
            return earlier
        configured = self._settings.incidents
        if pending:
            made = pending[-1].id
            pending[-1].until_ns = time.monotonic_ns() + configured.post_s * _NS_PER_S
            await self._merge(made, fault_id)
        else:
            trigger = f"{fault_id}: {message}" if message else fault_id
            manifest = await self.make(Kind.INCIDENT, configured.pre_s, configured.post_s, trigger=trigger)
            made = manifest.id
        self._incidents.made(fault_id, made, now_s)
        return made

    async def link(self, segment: RingSegment) -> None:
        """Adds a segment to the snapshots that it belongs to."""
        for snapshot in self._pending:
            manifest = self._catalogue.get(snapshot.id)
            if manifest and segment.overlaps(snapshot.from_ns, snapshot.until_ns):
                folder = self._catalogue.folder_of(manifest)
                linking = partial(link_next, folder, manifest, segment)
                linked = await attempt(f"{manifest.id} lacks a segment", linking)
                if linked:
                    snapshot.takes(segment)
                await self._keep(linked or _lacking(manifest, segment))

    async def finish(self, recording_id: str, reason: StopReason) -> None:
        """Ends a snapshot whose last segment is final."""
        manifest = self._catalogue.get(recording_id)
        if manifest:
            done = self._at_end(manifest)
            folder = self._catalogue.folder_of(done)
            complete = await attempt(
                f"{done.id} is completed later", lambda: ended(folder, done, RecordingState.COMPLETE, reason)
            )
            faulted = {"state": RecordingState.FAULTED, "stop_reason": StopReason.DISK}
            await self._keep(complete or done.model_copy(update=faulted))
            _log.info("%s is complete: %d segments", done.id, len(done.segments))
        self._pending = [each for each in self._pending if each.id != recording_id]

    def _begun(self, manifest: Manifest, segments: list[RingSegment]) -> Manifest:
        """Makes a snapshot's folder, with what the ring has of it already; in a thread."""
        try:
            folder = self._catalogue.create(manifest)
            for segment in segments:
                manifest = link_next(folder, manifest, segment)
            self._catalogue.write(manifest)
        except OSError:
            self._catalogue.discard(manifest)
            raise
        return manifest

    def _at_end(self, manifest: Manifest) -> Manifest:
        """Returns the manifest with the begin of what it contains, which may be later than was requested."""
        now_ms, now_ns = time.time_ns() // _NS_PER_MS, time.monotonic_ns()
        update: dict[str, Any] = {"ended_unix_ms": now_ms, "ended_monotonic_ns": now_ns}
        if manifest.window_ns:
            update["gaps"] = (*manifest.gaps, *self._outages.within(*manifest.window_ns, time.time_ns()))
        # The calendar clock may have been set meanwhile: the earliest time need not be the first message's.
        firsts = [each.first_ns for each in manifest.segments if each.first_ns is not None]
        if firsts:
            update["started_unix_ms"] = firsts[0] // _NS_PER_MS
        snapshot = next((each for each in self._pending if each.id == manifest.id), None)
        if snapshot and snapshot.first_ns is not None:
            update["started_monotonic_ns"] = max(0, min(snapshot.first_ns, now_ns))
        return manifest.model_copy(update=update)

    async def _merge(self, recording_id: str, fault_id: str) -> None:
        """Notes in an incident's manifest one more fault, and that it lasts longer for it."""
        before = self._catalogue.get(recording_id)
        if before and before.window_ns:
            trigger = f"{before.trigger}; {fault_id}"[:_LONGEST_TRIGGER]
            until_ns = time.time_ns() + self._settings.incidents.post_s * _NS_PER_S
            update = {"trigger": trigger, "window_ns": (before.window_ns[0], until_ns)}
            await self._keep(before.model_copy(update=update))

    async def _keep(self, manifest: Manifest) -> None:
        await attempt(
            f"the manifest of {manifest.id} is not on the disk", lambda: self._catalogue.write(manifest)
        )


def _lacking(manifest: Manifest, segment: RingSegment) -> Manifest:
    """Returns a snapshot's manifest with a gap for a segment that the disk has refused it."""
    summary = segment.summary
    first_ns = summary.first_ns or 0
    gap = Gap("", GapCause.DISK, first_ns, summary.last_ns or first_ns, summary.messages)
    return manifest.model_copy(update={"gaps": (*manifest.gaps, gap)})
