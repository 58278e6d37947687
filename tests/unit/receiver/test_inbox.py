import threading
import time

from console.receiver.errors import closed
from console.receiver.frame import Frame
from console.receiver.inbox import Inbox
from tests.unit.receiver.pictures import frame


def soon() -> float:
    return time.monotonic() + 10


def numbers(inbox: Inbox) -> list[int | None]:
    taken = []
    while isinstance(news := inbox.take(time.monotonic()), Frame):
        taken.append(news.pts_ns)
    return taken


def test_pictures_come_out_in_order() -> None:
    inbox = Inbox(4)
    for number in range(3):
        inbox.put(frame(number))
    assert numbers(inbox) == [0, 1, 2]
    assert (inbox.received, inbox.dropped) == (3, 0)


def test_the_oldest_goes_when_it_is_full() -> None:
    inbox = Inbox(2)
    for number in range(5):
        inbox.put(frame(number))
    assert (inbox.received, inbox.dropped) == (5, 3)
    assert numbers(inbox) == [3, 4]


def test_what_came_is_delivered_before_the_end() -> None:
    inbox = Inbox(2)
    end = closed()
    inbox.put(frame(7))
    inbox.end(end)
    first = inbox.take(soon())
    assert isinstance(first, Frame)
    assert inbox.take(soon()) is end
    assert inbox.take(soon()) is end


def test_the_first_reason_counts_until_it_is_reopened() -> None:
    inbox = Inbox(2)
    first, second = closed(), closed()
    inbox.end(first)
    inbox.end(second)
    assert inbox.take(soon()) is first
    inbox.reopen()
    assert inbox.take(time.monotonic()) is None
    inbox.end(second)
    assert inbox.take(soon()) is second


def test_a_waiting_caller_is_woken_by_a_picture() -> None:
    inbox = Inbox(1)
    taken: list[object] = []
    waiting = threading.Thread(target=lambda: taken.append(inbox.take(soon())))
    waiting.start()
    picture = frame(1)
    inbox.put(picture)
    waiting.join(10)
    assert taken == [picture]
