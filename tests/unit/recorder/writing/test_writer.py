"""What the writer's thread writes before it does what others ask of it."""

from dataclasses import replace
from pathlib import Path

from mcap.reader import make_reader

from recorder.intake.latched import LatchedCache
from recorder.values import VIDEO_TOPIC, Gap, GapCause, Note
from recorder.writing.output import Closed, Output, Shape
from recorder.writing.queue import MAX_NOTES, SampleQueue
from recorder.writing.writer import Writer
from tests.support.segments import STRING, string_sample
from tests.support.waiting import wait_until

VIDEO = replace(STRING, topic=VIDEO_TOPIC)


def test_a_recording_that_ends_before_the_next_key_frame_has_the_loss_of_the_video(tmp_path: Path) -> None:
    closed: list[Closed] = []
    queue = SampleQueue(1)
    writer = Writer(queue, LatchedCache(), lambda *_: None)
    shape = Shape(tmp_path, "{:06d}.mcap".format, 0, "all", True, 1 << 20, 60.0)
    output = Output(shape, writer.head, lambda _, each: closed.append(each))
    key, *rest = (replace(string_sample(at_ns, channel=VIDEO), follows=at_ns > 0) for at_ns in range(4))
    writer.start()
    try:
        writer.add(output).result()
        queue.put([key, rest[0]])
        wait_until(lambda: output.progress.frames, "the first frame is written")
        queue.put(rest[1:])
        writer.remove(output).result()
    finally:
        writer.stop()
    lost = Gap(VIDEO_TOPIC, GapCause.QUEUE, rest[0].log_time_ns, rest[-1].log_time_ns, 3)
    assert [gap for each in closed for gap in each.summary.gaps] == [lost]


def test_what_a_file_lacks_of_notes_is_in_no_later_one(tmp_path: Path) -> None:
    """The defect: every later file said once more that it lacked changes of the video's stream."""
    closed: list[Closed] = []
    queue = SampleQueue(1)
    writer = Writer(queue, LatchedCache(), lambda *_: None)
    shape = Shape(tmp_path, "{:06d}.mcap".format, 0, "all", True, 1 << 20, 60.0)
    output = Output(shape, writer.head, lambda _, each: closed.append(each))
    writer.start()
    try:
        writer.add(output).result()
        changes = [Note("video_stream", {"bitrate_kbps": str(number)}) for number in range(MAX_NOTES + 3)]
        queue.put([string_sample(0, channel=VIDEO), *changes])  # a file of its own: at another time than now
        writer.rotate(output).result()
        writer.remove(output).result()
    finally:
        writer.stop()
    _, first, later = (notes_of(each.summary.path, "video_stream") for each in closed)
    assert first[-1] == {"bitrate_kbps": "258", "notes_left_out": "2"}
    assert later == [{"bitrate_kbps": "258"}]


def notes_of(path: Path, name: str) -> list[dict[str, str]]:
    with path.open("rb") as file:
        return [each.metadata for each in make_reader(file).iter_metadata() if each.name == name]
