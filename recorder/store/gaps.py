"""The gaps of a recording: those of its manifest and of its segments, each once. Pure."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

from recorder.values import Gap, GapCause

MAX_GAPS: Final = 1000


def distinct(own: Sequence[Gap], of_segments: Iterable[Gap], from_ns: int | None) -> Iterator[Gap]:
    """Yields each gap once: an interruption is in the segment that follows it, too, which may be older.

    A segment of the ring may have one that began before what a snapshot is to contain.

    Args:
        own: of the manifest.
        of_segments: of its segments.
        from_ns: of a snapshot, when what it is to contain begins; None for other recordings.
    """
    yield from own
    known = [each for each in own if _stops_all_channels(each)]
    for gap in of_segments:
        if not _stops_all_channels(gap):
            yield gap
            continue
        part = _since(gap, from_ns)
        if part and not any(_are_one(part, each) for each in known):
            yield part


def bounded(gaps: list[Gap]) -> list[Gap]:
    """Returns at most 1000 gaps; the last one stands for all further ones."""
    if len(gaps) <= MAX_GAPS:
        return gaps
    kept, rest = gaps[: MAX_GAPS - 1], gaps[MAX_GAPS - 1 :]
    counts = [gap.messages for gap in rest]
    return [
        *kept,
        Gap(
            topic="",
            cause=rest[0].cause,
            began_ns=min(gap.began_ns for gap in rest),
            ended_ns=max(gap.ended_ns for gap in rest),
            messages=None if None in counts else sum(count or 0 for count in counts),
        ),
    ]


def _since(gap: Gap, from_ns: int | None) -> Gap | None:
    """Returns what of a gap does not lie before what a snapshot is to contain; None if all of it does.

    The window's end cuts nothing: where the clock was set forward, files within it have later times.
    """
    if from_ns is None:
        return gap
    return replace(gap, began_ns=max(gap.began_ns, from_ns)) if gap.ended_ns > from_ns else None


def _stops_all_channels(gap: Gap) -> bool:
    """Returns whether a gap is of all channels, and of unknown size: as what an interruption has cost."""
    causes = (GapCause.INTERRUPTED, GapCause.DISK)
    return gap.cause in causes and not gap.topic and gap.messages is None


def _are_one(gap: Gap, other: Gap) -> bool:
    """Returns whether two interruptions are the same: of two that follow each other, one instant is shared.

    The cause alone says little: the ring's own numbers do not have it, a file has.
    """
    shared_ns = min(gap.ended_ns, other.ended_ns) - max(gap.began_ns, other.began_ns)
    return shared_ns > 0 or (shared_ns == 0 and gap.cause is other.cause)
