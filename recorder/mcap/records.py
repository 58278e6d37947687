"""What the recorder's segments hold besides messages: names, and what is missing as metadata records."""

from collections.abc import Iterable
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.records import McapRecord

from recorder.values import Gap, GapCause, Note

PROFILE: Final = "ros2"
"""MCAP's profile of files with ROS 2 messages."""
CDR: Final = "cdr"
"""MCAP's name of the encoding of ROS 2 messages."""
OFFERED_QOS: Final = "offered_qos_profiles"
"""Key of a channel's metadata, as rosbag2 writes it."""
PART: Final = ".part"
"""Suffix of a segment that still grows."""
GAP: Final = "gap"
"""Name of the metadata record of a gap."""
UNNUMBERED: Final = "unnumbered"
"""Name of the metadata record of a file with messages that the middleware has not numbered."""


def note_of_gap(gap: Gap) -> Note:
    """Returns the gap as a note; an unknown number of messages is left out."""
    values = {
        "topic": gap.topic,
        "cause": gap.cause.value,
        "began_ns": str(gap.began_ns),
        "ended_ns": str(gap.ended_ns),
    }
    if gap.messages is not None:
        values["messages"] = str(gap.messages)
    return Note(GAP, values)


def gap_of_note(note: Note) -> Gap | None:
    """Returns the gap of a note; None if it is another note, or none that `note_of_gap` made."""
    if note.name != GAP:
        return None
    try:
        messages = note.values.get("messages")
        return Gap(
            topic=note.values["topic"],
            cause=GapCause(note.values["cause"]),
            began_ns=int(note.values["began_ns"]),
            ended_ns=int(note.values["ended_ns"]),
            messages=None if messages is None else int(messages),
        )
    except (KeyError, ValueError):
        return None


def bytes_of(records: Iterable[McapRecord]) -> bytes:
    """Returns the records as they lie in a file."""
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return bytes(builder.end())
