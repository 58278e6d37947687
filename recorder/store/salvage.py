"""Making whole what was cut off: unfinished segments, and recordings that never ended. For a thread."""

import logging
import time
from dataclasses import replace
from pathlib import Path
from typing import Final

from recorder.mcap.records import PART
from recorder.mcap.recovery import is_untouched, recover
from recorder.mcap.rosbag2 import metadata
from recorder.store.catalogue import Catalogue, readable, segments_in
from recorder.store.folder import DATA, METADATA, put_aside, replace_file
from recorder.store.manifest import Kind, Manifest, RecordingState, StopReason, file_of
from recorder.store.outages import parts_within
from recorder.store.ring import Ring, link_next
from recorder.store.room import is_full
from recorder.values import Gap, GapCause

_log = logging.getLogger(__name__)
_NS_PER_MS: Final = 1_000_000


def whole(folder: Path, manifest: Manifest) -> Manifest:
    """Returns the manifest with all segments that the folder has, after unfinished ones have got their index.

    One that can't be made whole costs no other one: a gap stands for it.

    Raises:
        OSError: the disk is full; what has been made whole by then stays so.
    """
    for part in segments_in(folder, PART):
        manifest = _with_part(manifest, part)
    known = {segment.name for segment in manifest.segments}
    for path in segments_in(folder):
        name = f"{DATA}/{path.name}"
        if name in known:
            continue
        summary = readable(path)
        manifest = manifest.with_segment(name, summary) if summary else manifest.without_segment(name)
    return manifest


def _with_part(manifest: Manifest, part: Path) -> Manifest:
    """Returns the manifest with an unfinished segment, or with a gap for one that can't be made whole."""
    name = f"{DATA}/{part.name.removesuffix(PART)}"
    try:
        summary = recover(part)
        if summary is None and not _clear_away(part):
            return manifest.without_segment(name)
    except FileExistsError:
        _log.error("%s: another file has its final name; it is kept as %s", part, put_aside(part).name)
        return manifest.without_segment(name)
    except OSError as error:
        if is_full(error):
            raise
        _log.error("%s can't be made whole, and is tried again at the next start: %s", part, error.strerror)
        return manifest.without_segment(name)
    if summary is None:
        return manifest
    _log.info("recovered %s: %d messages", summary.path, summary.messages)
    return manifest.with_segment(name, summary)


def _clear_away(part: Path) -> bool:
    """Deletes an unfinished segment that is empty, and returns True; keeps a damaged one aside."""
    if is_untouched(part):
        part.unlink()
        return True
    _log.warning("%s can't be recovered and is kept as %s", part, put_aside(part).name)
    return False


def ended(folder: Path, manifest: Manifest, state: RecordingState, reason: StopReason) -> Manifest:
    """Returns the manifest of a recording that has ended, and writes rosbag2's file beside its segments.

    A copy has that file, and the manifest not: what else is known of the recording is in both.

    Raises:
        OSError: the disk is full or fails.
    """
    update = {"state": state, "stop_reason": reason}
    done = _until_next_messages(manifest.model_copy(update=update)).spanning()
    text = metadata(done.summaries(folder), done.about).encode()
    replace_file(folder / METADATA, text)
    return done.model_copy(update={"metadata": file_of(METADATA, text)})


def salvage(catalogue: Catalogue, ring: Ring | None, boot_id: str) -> Manifest | None:
    """Makes every recording whole that a former process has left open.

    Args:
        catalogue: as loaded.
        ring: as loaded; None without one.
        boot_id: of the computer now.

    Returns:
        The recording that is to go on: it ran during the same boot.

    Raises:
        OSError: the disk is full. One that fails in another way costs the recordings alone that it fails.
    """
    goes_on: Manifest | None = None
    for manifest in sorted(catalogue.all.values(), key=lambda each: each.id):
        try:
            running = _salvaged(catalogue, manifest, ring, boot_id)
            if running and goes_on:
                _interrupted(catalogue, goes_on)
            goes_on = running or goes_on
        except OSError as error:
            if is_full(error):
                raise
            catalogue.set_aside(manifest, error)
    return goes_on


def _salvaged(catalogue: Catalogue, manifest: Manifest, ring: Ring | None, boot_id: str) -> Manifest | None:
    """Makes one recording whole, and returns it if it is to go on."""
    if manifest.id in catalogue.unread:
        return None  # What would be written knows nothing of it.
    folder = catalogue.folder_of(manifest)
    if not manifest.state.open and not segments_in(folder, PART):
        return None
    found = whole(folder, manifest)
    if manifest.window_ns and ring:
        found = _with_ring(folder, found, ring)
    running = manifest.state is RecordingState.RECORDING and manifest.kind is Kind.MANUAL
    if running and manifest.boot_id == boot_id and boot_id:
        catalogue.write(found)
        return found
    if manifest.state.open:
        _interrupted(catalogue, found)
    else:
        catalogue.write(ended(folder, found, found.state, found.stop_reason or StopReason.ERROR))
    return None


def _interrupted(catalogue: Catalogue, manifest: Manifest) -> None:
    cut = _with_rest_of_window(manifest) if manifest.window_ns else with_interruption(manifest, None)
    folder = catalogue.folder_of(manifest)
    catalogue.write(ended(folder, cut, RecordingState.RECOVERED, StopReason.INTERRUPTED))


def _with_rest_of_window(manifest: Manifest) -> Manifest:
    """Returns a snapshot's manifest with a gap from its newest message to the end of its window."""
    _, until_ns = manifest.window_ns or (0, 0)
    complete = any((each.last_ns or 0) >= until_ns for each in manifest.segments)
    return manifest if complete else with_interruption(manifest, until_ns)


def with_interruption(manifest: Manifest, until_ns: int | None) -> Manifest:
    """Returns the manifest with a gap from its newest message on.

    Args:
        manifest: of a recording that was cut off.
        until_ns: when it goes on, or was to end, by the calendar clock; None: never, and how much is missing
            is unknown.
    """
    lasts = [each.last_ns for each in manifest.segments if each.last_ns is not None]
    began_ns = max(lasts, default=manifest.started_unix_ms * _NS_PER_MS)
    ended_ns = began_ns if until_ns is None else max(began_ns, until_ns)
    gap = Gap("", GapCause.INTERRUPTED, began_ns, ended_ns, None)
    return manifest.model_copy(update={"gaps": (*manifest.gaps, gap)})


def _until_next_messages(manifest: Manifest) -> Manifest:
    """Returns the manifest with each interruption lasting until the first message after it.

    What is published while the recorder opens its files, and before it has subscribed, is missing, too.
    """
    firsts = sorted(each.first_ns for each in manifest.segments if each.first_ns is not None)
    gaps = []
    for gap in manifest.gaps:
        next_ns = next((first_ns for first_ns in firsts if first_ns > gap.began_ns), 0)
        longer = gap.cause is GapCause.INTERRUPTED and next_ns > gap.ended_ns
        gaps.append(replace(gap, ended_ns=next_ns) if longer else gap)
    return manifest.model_copy(update={"gaps": tuple(gaps)})


def _with_ring(folder: Path, manifest: Manifest, ring: Ring) -> Manifest:
    """Returns a snapshot's manifest with what its window has in the ring, linked, and gaps of the ring's."""
    window = manifest.window_ns
    assert window, "only snapshots have one"  # noqa: S101  # the caller has looked
    offset_ns = time.monotonic_ns() - time.time_ns()
    from_ns, until_ns = (instant + offset_ns for instant in window)
    known = {segment.sha256 for segment in manifest.segments}
    for segment in ring.within(from_ns, until_ns):
        if segment.summary.sha256 not in known:
            manifest = link_next(folder, manifest, segment)
    lost = parts_within(ring.losses(), *window)
    return manifest.model_copy(update={"gaps": (*manifest.gaps, *lost)})
