"""What others read of the recorder."""

from collections.abc import Hashable
from pathlib import Path
from typing import Final

from common.broadcast import Broadcast
from common.errors import NotFoundError
from common.reasons import Reason
from recorder.recording.assembly import Parts
from recorder.recording.lifecycle import Phase
from recorder.recording.requests import Live
from recorder.store.housekeeping import LEAST_ROOM, Room
from recorder.store.manifest import Manifest
from recorder.values import Losses

NEWEST_ENDED: Final = 16
_SHORT_S: Final = 3600.0


class StatusReader:
    """The recorder as it is at this moment; used on its event loop.

    Args:
        parts: of the recorder.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self.run_id = parts.run_id

    @property
    def changes(self) -> Broadcast:
        """Notified of every change but those that go on all the time: times, the disk's free bytes."""
        return self._parts.lifecycle.changes

    @property
    def change_key(self) -> Hashable:
        """Differs whenever something has changed of which `changes` notifies."""
        parts = self._parts
        return (
            parts.lifecycle.phase,
            self.last_error,
            self.disk_short,
            self.snapshots_pending,
            parts.catalogue.revision,
            tuple(each.progress for each in parts.outputs.all),
        )

    @property
    def phase(self) -> Phase:
        """The lifecycle's state."""
        return self._parts.lifecycle.phase

    @property
    def last_error(self) -> str:
        """Why it can't record, or not all of what is wanted; empty when all is well."""
        parts = self._parts
        ring = parts.ring.problem if parts.ring else ""
        recordings = next(iter(list(parts.catalogue.problems.values())), "")
        return parts.lifecycle.error or ring or parts.sources.problem or recordings

    @property
    def running(self) -> Manifest | None:
        """The recording that runs."""
        return self._parts.manual.running

    @property
    def newest(self) -> Manifest | None:
        """The recording that runs or has ended last; None before the first of this process."""
        return self.running or self._parts.catalogue.get(self._parts.manual.newest_id)

    @property
    def recordings(self) -> list[Manifest]:
        """All recordings, the newest first."""
        return sorted(self._parts.catalogue.all.values(), key=lambda each: each.id, reverse=True)

    @property
    def recently_ended(self) -> list[Manifest]:
        """The recordings that ended last, the newest first."""
        done = [each for each in list(self._parts.catalogue.all.values()) if not each.state.open]
        # The calendar clock may have been set back since.
        return sorted(done, key=lambda each: (each.ordinal, each.ended_unix_ms), reverse=True)[:NEWEST_ENDED]

    @property
    def room(self) -> Room:
        """The disk, as measured last."""
        return self._parts.housekeeping.room

    @property
    def room_s(self) -> float | None:
        """How long the room lasts at the present rate, that of deletable recordings included.

        None while no recording is written.
        """
        outputs = self._parts.outputs
        if not (outputs.recording and outputs.bytes_per_s):
            return None
        return self._whole_room_bytes / outputs.bytes_per_s

    @property
    def disk_short(self) -> bool:
        """Whether room for less than an hour is left, the ring had to give way, or a recording to end."""
        parts = self._parts
        if parts.lifecycle.stopped_by_disk or (parts.ring and parts.ring.short):
            return True
        if not self.room.disk.size_bytes:
            return False  # It has not been measured yet.
        if (room_s := self.room_s) is not None:
            return room_s < _SHORT_S
        rate = self.bytes_per_minute[self._parts.settings.first_preset] / 60
        return self._whole_room_bytes < max(LEAST_ROOM, rate * _SHORT_S)

    @property
    def _whole_room_bytes(self) -> int:
        housekeeping = self._parts.housekeeping
        return max(0, housekeeping.room.bytes + housekeeping.deletable_bytes)

    @property
    def writes(self) -> bool:
        """Whether anything is written at present."""
        return bool(self._parts.outputs.all)

    @property
    def bytes_per_s(self) -> int:
        """What is written at present."""
        return self._parts.outputs.bytes_per_s

    @property
    def bytes_per_minute(self) -> dict[str, int]:
        """What each preset took when it was last recorded with video, or without, as it is by default."""
        settings, state_file = self._parts.settings, self._parts.state_file
        return {
            each: state_file.bytes_per_minute(each, with_video=settings.records_video(each))
            for each in settings.presets
        }

    @property
    def snapshots_pending(self) -> int:
        """Snapshots that are being made."""
        return self._parts.ring.snapshots.pending if self._parts.ring else 0

    @property
    def ring_s(self) -> int:
        """Seconds that the ring holds."""
        return self._parts.ring.held_s if self._parts.ring else 0

    @property
    def ring_failures(self) -> int:
        """Attempts to write the ring that failed since the last success."""
        return self._parts.ring.retries.failures if self._parts.ring else 0

    @property
    def dropped(self) -> int:
        """Messages dropped because the queue was full."""
        return self._parts.queue.dropped

    @property
    def losses(self) -> Losses:
        """What is missing from what is written at present."""
        return self._parts.outputs.losses

    def live(self, manifest: Manifest) -> Live:
        """Returns how far a recording has come, including what of it is not final yet."""
        return self._parts.manual.live(manifest)

    def has(self, recording_id: str) -> bool:
        """Returns whether there is such a recording."""
        return self._parts.catalogue.get(recording_id) is not None

    def get(self, recording_id: str) -> Manifest:
        """Returns a recording.

        Raises:
            NotFoundError: there is no such.
        """
        found = self._parts.catalogue.get(recording_id)
        if found is None:
            raise NotFoundError(
                f"there is no recording '{recording_id}'; ListRecordings has those there are",
                Reason.RECORDING_NOT_FOUND,
            )
        return found

    def folder_of(self, manifest: Manifest) -> Path:
        """Returns the folder of a recording."""
        return self._parts.catalogue.folder_of(manifest)
