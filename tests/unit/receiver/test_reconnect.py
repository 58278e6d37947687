"""The receiver's policy, with connections that the test plays."""

import threading
import time
from itertools import pairwise

import pytest

from console.receiver.address import StreamAddress
from console.receiver.errors import (
    NoPictureError,
    ReceiverClosedError,
    StreamEndedError,
    StreamRefusedError,
    ended,
    from_srt,
)
from console.receiver.inbox import Inbox
from console.receiver.receiver import Receiver, Reconnect
from tests.unit.receiver.pictures import frame

ADDRESS = StreamAddress("robot")
AT_ONCE = Reconnect(first_s=0.0)
NEVER = Reconnect(first_s=1e6, longest_s=1e6)


class Exchange:
    """Plays one script per call: what the connection puts into the inbox when it is made."""

    def __init__(self, *scripts: str) -> None:
        self._scripts = list(scripts)
        self.open = 0
        self.dialled_s: list[float] = []

    def dial(self, address: StreamAddress, inbox: Inbox) -> "Exchange":
        self.open += 1
        self.dialled_s.append(time.monotonic())
        for step in self._scripts.pop(0) if self._scripts else "":
            match step:
                case "f":
                    inbox.put(frame())
                case "e":
                    inbox.end(ended(address, "lost"))
                case "p":
                    inbox.end(from_srt(address, "Incorrect password", had_data=False))
        return self

    def close(self) -> None:
        self.open -= 1


def test_without_reconnect_the_end_is_told_after_the_last_picture() -> None:
    exchange = Exchange("ffe")
    with Receiver(ADDRESS, dial=exchange.dial) as receiver:
        receiver.next_frame(1)
        receiver.next_frame(1)
        for _ in range(2):
            with pytest.raises(StreamEndedError, match="lost"):
                receiver.next_frame(1)
    assert exchange.open == 0


def test_with_reconnect_the_loss_is_not_seen() -> None:
    exchange = Exchange("fe", "e", "ff")
    with Receiver(ADDRESS, reconnect=AT_ONCE, dial=exchange.dial) as receiver:
        for _ in range(3):
            receiver.next_frame(10)
        assert receiver.reconnects == 2
        assert exchange.open == 1


def test_what_calling_again_cannot_mend_is_told_at_once() -> None:
    exchange = Exchange("p", "f")
    with (
        Receiver(ADDRESS, reconnect=AT_ONCE, dial=exchange.dial) as receiver,
        pytest.raises(StreamRefusedError, match="passphrase"),
    ):
        receiver.next_frame(10)


def test_the_callers_deadline_is_shorter_than_the_wait() -> None:
    exchange = Exchange("e", "f")
    with Receiver(ADDRESS, reconnect=NEVER, dial=exchange.dial) as receiver:
        for _ in range(3):
            with pytest.raises(NoPictureError, match="lost"):
                receiver.next_frame(0.01)
        assert receiver.reconnects == 0


def test_waits_grow_to_their_limit_and_begin_anew_after_a_picture() -> None:
    exchange = Exchange("e", "e", "e", "fe", "f")
    policy = Reconnect(first_s=0.05, factor=4, longest_s=0.3)
    with Receiver(ADDRESS, reconnect=policy, dial=exchange.dial) as receiver:
        receiver.next_frame(10)
        receiver.next_frame(10)
    waits_s = [later - earlier for earlier, later in pairwise(exchange.dialled_s)]
    assert all(wait >= least for wait, least in zip(waits_s, (0.05, 0.2, 0.3, 0.05), strict=True))
    assert waits_s[3] < waits_s[2]


def test_closing_wakes_who_waits_for_a_picture() -> None:
    closing_ends_the_wait(Receiver(ADDRESS, dial=Exchange("").dial))


def test_closing_wakes_who_waits_for_the_next_call() -> None:
    closing_ends_the_wait(Receiver(ADDRESS, reconnect=NEVER, dial=Exchange("e").dial))


def closing_ends_the_wait(receiver: Receiver) -> None:
    caught: list[BaseException] = []

    def wait() -> None:
        try:
            receiver.next_frame(1000)
        except ReceiverClosedError as error:
            caught.append(error)

    waiting = threading.Thread(target=wait)
    waiting.start()
    receiver.close()
    waiting.join(10)
    assert len(caught) == 1


def test_closing_twice_hangs_up_once() -> None:
    exchange = Exchange("f")
    receiver = Receiver(ADDRESS, dial=exchange.dial)
    receiver.close()
    receiver.close()
    assert exchange.open == 0
