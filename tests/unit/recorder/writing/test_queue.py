"""The queue: order, its bound, and what becomes of what does not fit."""

import threading
import time
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from recorder.values import VIDEO_TOPIC, Channel, Ended, GapCause, Item, Loss, Note, Sample
from recorder.writing.queue import MAX_NOTES, SampleQueue

ODOM, SCAN = (
    Channel(topic, "std_msgs/msg/String", b"", "", "", latched=False, presets=frozenset())
    for topic in ("/odom", "/scan")
)
VIDEO = replace(ODOM, topic=VIDEO_TOPIC)


def sample(of: Channel = ODOM, at_ns: int = 0, size: int = 100) -> Sample:
    return Sample(of, bytes(size), at_ns, at_ns, at_ns, at_ns)


def test_what_was_put_comes_out_in_order() -> None:
    queue = SampleQueue(10_000)
    loss = Loss(ODOM, GapCause.MIDDLEWARE, 1, 2, 3)
    items: list[Item] = [sample(at_ns=1), Note("a", {}), loss, sample(SCAN, 4)]
    queue.put(items)
    assert queue.take(0) == items
    assert queue.take(0) == []


@given(st.lists(st.tuples(st.sampled_from([ODOM, SCAN]), st.integers(0, 2000)), max_size=60))
def test_nothing_vanishes_without_a_loss(sent: list[tuple[Channel, int]]) -> None:
    queue = SampleQueue(5000)
    queue.put([sample(of, at, size) for at, (of, size) in enumerate(sent)])
    taken = queue.take(0)
    for of in (ODOM, SCAN):
        arrived = sum(isinstance(each, Sample) and each.channel is of for each in taken)
        losses = [each for each in taken if isinstance(each, Loss) and each.channel is of]
        assert len(losses) <= 1, "one for each channel"
        assert arrived + sum(each.messages or 0 for each in losses) == sum(to is of for to, _ in sent)
    assert queue.dropped == len(sent) - sum(isinstance(each, Sample) for each in taken)


def frame(at_ns: int, *, key: bool = False) -> Sample:
    return replace(sample(VIDEO, at_ns), follows=not key)


def test_what_follows_a_dropped_frame_is_dropped_up_to_the_next_key_frame() -> None:
    """The defect: frames were recorded that no decoder shows as they were."""
    queue = SampleQueue(800)
    first, second = frame(0, key=True), frame(1)
    queue.put([first, second, frame(2)])
    assert queue.take(0) == [first, second]
    topic = sample(at_ns=3)
    queue.put([frame(3), topic, frame(4)])
    assert queue.take(0) == [topic]
    again = [frame(5, key=True), frame(6)]
    queue.put(again)
    assert queue.take(0) == [*again, Loss(VIDEO, GapCause.QUEUE, 2, 4, 3)]
    assert queue.dropped == 3


def test_a_key_frame_that_is_dropped_takes_what_follows_with_it() -> None:
    queue = SampleQueue(400)
    queue.put([sample(), frame(1, key=True)])
    assert queue.take(0) == [sample()]
    queue.put([frame(2)])
    assert queue.take(0) == []
    queue.put([sample(), frame(3, key=True)])
    assert queue.take(0) == [sample()]
    queue.put([frame(4, key=True)])
    assert queue.take(0) == [frame(4, key=True), Loss(VIDEO, GapCause.QUEUE, 1, 3, 3)]


def test_frames_dropped_up_to_the_next_key_frame_are_one_loss() -> None:
    """The defect: each of them was taken as a loss of its own, and a manifest keeps 1000 gaps."""
    queue = SampleQueue(400)
    queue.put([frame(0, key=True), frame(1)])
    taken = queue.take(0)
    for at_ns in range(2, 60):
        queue.put([frame(at_ns)])
        taken += queue.take(0)
    queue.put([frame(60, key=True)])
    assert [each for each in [*taken, *queue.take(0)] if isinstance(each, Loss)] == [
        Loss(VIDEO, GapCause.QUEUE, 1, 59, 59)
    ]


def test_before_an_output_may_be_closed_the_loss_so_far_is_taken() -> None:
    queue = SampleQueue(400)
    queue.put([frame(0, key=True), frame(1), frame(2)])
    assert queue.take(0, so_far=True) == [frame(0, key=True), Loss(VIDEO, GapCause.QUEUE, 1, 2, 2)]
    assert queue.take(0, so_far=True) == []
    queue.put([frame(3)])
    assert queue.take(0) == []
    queue.put([frame(4, key=True)])
    assert queue.take(0) == [frame(4, key=True), Loss(VIDEO, GapCause.QUEUE, 3, 3, 1)]


def test_a_message_larger_than_the_queue_passes_alone() -> None:
    queue = SampleQueue(1000)
    queue.put([sample(size=100_000), sample(at_ns=7)])
    taken = queue.take(0)
    assert taken[1] == Loss(ODOM, GapCause.QUEUE, 7, 7, 1)


def test_losses_of_a_full_queue_are_merged() -> None:
    queue = SampleQueue(300)
    queue.put([sample()])
    queue.put([Loss(ODOM, GapCause.MIDDLEWARE, at, at + 1, 2) for at in range(1000)])
    _, loss = queue.take(0)
    assert loss == Loss(ODOM, GapCause.MIDDLEWARE, 0, 1000, 2000)


def notes(count: int, name: str = "video_stream") -> list[Note]:
    return [Note(name, {"bitrate_kbps": str(number)}) for number in range(count)]


def test_a_full_queue_keeps_every_change_that_a_note_is_of() -> None:
    """The defect: all but the newest were replaced, as if the bit rate had changed once."""
    queue = SampleQueue(300)
    queue.put([sample(), sample(at_ns=1), *notes(40), sample(at_ns=2), *notes(2, "video_clock")])
    loss = Loss(ODOM, GapCause.QUEUE, 1, 2, 2)
    assert queue.take(0) == [sample(), *notes(40), *notes(2, "video_clock"), loss]
    queue.put([sample(), sample(), *notes(MAX_NOTES)])
    assert queue.take(0)[1:-1] == notes(MAX_NOTES), "as many as before"


def test_notes_of_a_full_queue_are_bounded_and_those_left_out_counted() -> None:
    queue = SampleQueue(300)
    queue.put([sample(), *notes(MAX_NOTES), *notes(1000), *notes(1, "video_clock")])
    taken = queue.take(0)[1:]
    assert taken[:-2] == notes(MAX_NOTES)
    assert taken[-2:] == [
        Note("video_stream", {"bitrate_kbps": "999", "notes_left_out": "999"}),
        *notes(1, "video_clock"),
    ]
    queue.put(notes(1))
    assert queue.take(0) == notes(1)


def test_a_wake_ends_the_wait() -> None:
    queue = SampleQueue(1000)
    timer = threading.Timer(0.05, queue.wake)
    timer.start()
    began_s = time.monotonic()
    assert queue.take(10) == []
    assert time.monotonic() - began_s < 5
    timer.join()


def test_that_a_topic_has_ended_is_never_dropped() -> None:
    queue = SampleQueue(1)
    queue.put([sample(), sample(), Ended(ODOM)])
    assert Ended(ODOM) in queue.take(0.0)
