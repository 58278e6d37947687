"""What waits for a decoder, and for how long."""

from console.receiver.decoder_queue import DecoderQueue
from console.receiver.transport_stream import AccessUnit

FPS = 30


def unit(number: int, *, first: bool = False) -> AccessUnit:
    return AccessUnit("h264", b"", number, first)


def taken(queue: DecoderQueue) -> list[int | None]:
    found = []
    while each := queue.take():
        found.append(each[1].pts_ticks)
    return found


def test_units_leave_in_the_order_in_which_they_came_and_with_the_time() -> None:
    queue = DecoderQueue()
    assert queue.take() is None
    assert all(queue.put(unit(number), number / FPS) for number in range(3))
    assert queue.take() == (0.0, unit(0))
    assert taken(queue) == [1, 2]
    assert queue.dropped == 0


def test_what_comes_while_the_oldest_waits_for_too_long_is_refused() -> None:
    queue = DecoderQueue()
    assert queue.put(unit(0, first=True), 0.0)
    assert queue.put(unit(1), 0.6)
    assert not queue.put(unit(2), 0.61)
    assert queue.dropped == 1
    queue.take()
    assert queue.put(unit(3), 0.7), "the oldest waits for 0.1 s"


def test_a_key_frame_takes_the_place_of_what_waits_for_too_long() -> None:
    queue = DecoderQueue()
    for number in range(10):
        queue.put(unit(number), number / FPS)
    assert queue.put(unit(50, first=True), 50 / FPS)
    assert taken(queue) == [50]
    assert queue.dropped == 10


def test_a_key_frame_in_time_waits_behind_the_others() -> None:
    queue = DecoderQueue()
    queue.put(unit(0), 0.0)
    queue.put(unit(1, first=True), 0.1)
    assert taken(queue) == [0, 1]


def test_a_burst_is_taken_up_to_a_bound() -> None:
    """What was held for a lost packet comes at once."""
    queue = DecoderQueue()
    assert sum(queue.put(unit(number), 5.0) for number in range(1000)) == 90
    assert queue.put(unit(1000, first=True), 5.0)
    assert taken(queue) == [1000]
    assert queue.dropped == 910 + 90
