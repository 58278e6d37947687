import threading
import time

from console.receiver.address import StreamAddress
from console.receiver.errors import ended
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from tests.unit.console.receiver.frames import frame

ADDRESS = StreamAddress("robot")


def soon() -> float:
    return time.monotonic() + 10


def numbers(queue: FrameQueue) -> list[int | None]:
    taken = []
    while isinstance(next_frame := queue.take(time.monotonic()), Frame):
        taken.append(next_frame.pts_ns)
    return taken


def test_frames_come_out_in_order() -> None:
    queue = FrameQueue(4)
    for number in range(3):
        queue.put(frame(number))
    assert numbers(queue) == [0, 1, 2]


def test_the_oldest_goes_when_it_is_full() -> None:
    queue = FrameQueue(2)
    for number in range(5):
        queue.put(frame(number))
    assert numbers(queue) == [3, 4]


def test_what_came_is_delivered_before_the_end() -> None:
    queue = FrameQueue(2)
    end = ended(ADDRESS)
    queue.put(frame(7))
    queue.end(end)
    first = queue.take(soon())
    assert isinstance(first, Frame)
    assert queue.take(soon()) is end
    assert queue.take(soon()) is end


def test_the_first_cause_of_the_end_counts() -> None:
    queue = FrameQueue(2)
    first, second = ended(ADDRESS), ended(ADDRESS)
    assert queue.take(time.monotonic()) is None
    queue.end(first)
    queue.end(second)
    assert queue.take(soon()) is first


def test_a_waiting_caller_is_woken_by_a_frame() -> None:
    queue = FrameQueue(1)
    taken: list[object] = []
    waiting = threading.Thread(target=lambda: taken.append(queue.take(soon())))
    waiting.start()
    one = frame(1)
    queue.put(one)
    waiting.join(10)
    assert taken == [one]
