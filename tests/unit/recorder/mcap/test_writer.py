from pathlib import Path

from mcap.reader import make_reader

from recorder.mcap.writer import SegmentWriter
from recorder.values import Channel, GapCause, Loss, Note, Sample

ODOM = Channel("/odom", "std_msgs/msg/String", b"string data\n", "ros2msg", "[]", False, frozenset())


def sample(number: int, data: bytes = b"\0\1\0\0\2\0\0\0a\0") -> Sample:
    return Sample(ODOM, data, 1_000 + number, 500 + number, number, number)


def test_a_finished_segment_has_what_was_written(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path / "000000.mcap.part", head=[Note("clock", {"a": "b"})])
    for number in range(5):
        writer.write(sample(number))
    writer.loss(Loss(ODOM, GapCause.MIDDLEWARE, 1, 2, 3))
    writer.flush()
    summary = writer.finish()
    assert summary.path == tmp_path / "000000.mcap"
    assert summary.messages == 5
    with summary.path.open("rb") as file:
        read = make_reader(file, validate_crcs=True)
        assert [message.sequence for _, _, message in read.iter_messages()] == list(range(5))
        assert [each.name for each in read.iter_metadata()] == ["clock", "gap"]
