"""Segments of recordings for tests: written by the recorder, read by independent readers."""

from collections.abc import Sequence
from pathlib import Path

from mcap.reader import NonSeekingReader, make_reader

from recorder.mcap.writer import SegmentWriter
from recorder.values import Channel, Note, Sample

STRING = Channel(
    topic="/chatter",
    type="std_msgs/msg/String",
    schema=b"string data\n",
    schema_encoding="ros2msg",
    offered_qos="[]",
    latched=False,
    presets=frozenset(),
)
BYTE = Channel("/byte", "std_msgs/msg/Byte", b"byte data\n", "ros2msg", "[]", False, frozenset())


def string_cdr(text: str) -> bytes:
    """Returns a std_msgs/String as CDR, little-endian."""
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + len(data).to_bytes(4, "little") + data


def string_sample(number: int, text: str = "", channel: Channel = STRING) -> Sample:
    """Returns a message that is logged and published at `number` ns after 1 s; DDS counts from 1."""
    at_ns = 1_000_000_000 + number
    return Sample(channel, string_cdr(text or f"number {number}"), at_ns, at_ns - 1, number + 1, number)


def unfinished_segment(path: Path, chunks: Sequence[int], *, head: Sequence[Note] = ()) -> Path:
    """Writes a segment as a killed recorder leaves it, with that many messages in each chunk."""
    writer = SegmentWriter(path, head=head)
    number = 0
    for length in chunks:
        for _ in range(length):
            writer.write(string_sample(number, channel=BYTE if number % 3 == 2 else STRING))
            number += 1
        writer.flush()
    writer.abandon()
    return path


def indexed_log_times(path: Path) -> list[int]:
    """Returns the log times as a reader that trusts the index gives them."""
    with path.open("rb") as file:
        return [message.log_time for _, _, message in make_reader(file, validate_crcs=True).iter_messages()]


def linear_log_times(path: Path) -> list[int]:
    """Returns the log times as a reader that goes from begin to end gives them."""
    with path.open("rb") as file:
        reader = NonSeekingReader(file, validate_crcs=True)
        return [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
