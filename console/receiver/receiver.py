"""A stream of the robot's preview as decoded pictures."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Protocol, Self

from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError, closed, nothing_within
from console.receiver.frame import Frame
from console.receiver.inbox import Inbox
from console.receiver.setup import Setup


class Call(Protocol):
    """A connection under way or standing."""

    def close(self) -> None:
        """Hangs up; after it nothing reaches the inbox."""


Dial = Callable[[StreamAddress, Inbox], Call]


def _dial(address: StreamAddress, inbox: Inbox, setup: Setup) -> Call:
    # Imported here so that a program without GStreamer fails only when it is asked for pictures.
    from console.receiver.connection import Connection  # noqa: PLC0415

    return Connection(address, inbox, setup)


@dataclass(frozen=True, slots=True)
class Reconnect:
    """How often to call again after a lost connection.

    Args:
        first_s: wait before the first new call, in seconds.
        factor: by how much each further wait is longer.
        longest_s: no wait is longer, in seconds.
    """

    first_s: float = 0.1
    factor: float = 2.0
    longest_s: float = 2.0


class _Redialling:
    """When to call again: each wait longer than the one before, until a picture comes."""

    def __init__(self, policy: Reconnect) -> None:
        self._policy = policy
        self._wait_s = policy.first_s
        self._due_s: float | None = None

    def due_s(self) -> float:
        """When the next call is due, on `time.monotonic()`; the same answer until it was made."""
        if self._due_s is None:
            self._due_s = time.monotonic() + self._wait_s
        return self._due_s

    def called(self) -> None:
        """The call was made: the next wait is longer."""
        self._due_s = None
        self._wait_s = min(self._wait_s * self._policy.factor, self._policy.longest_s)

    def succeeded(self) -> None:
        """A picture came: the next loss begins with the shortest wait again."""
        self._due_s = None
        self._wait_s = self._policy.first_s


class Receiver:
    """Connects at once and decodes in the background until it is closed.

        with Receiver(StreamAddress("robot.local")) as receiver:
            frame = receiver.next_frame(timeout_s=5)

    Pictures nobody takes in time are thrown away, oldest first: a slow caller sees fewer pictures, never old
    ones. `next_frame` belongs to one thread; `close` may be called from any.

    Args:
        address: what to call.
        queue_size: how many decoded pictures may wait for the caller.
        reconnect: call again when the connection is lost, inside `next_frame`; None raises the reason.
        setup: what the caller wants of the pictures, and whether the stream is kept.
        dial: makes connections; only tests give another one.

    Raises:
        UserError: GStreamer or one of its elements is not installed.
    """

    def __init__(
        self,
        address: StreamAddress,
        *,
        queue_size: int = 2,
        reconnect: Reconnect | None = None,
        setup: Setup | None = None,
        dial: Dial | None = None,
    ) -> None:
        self._address = address
        self._inbox = Inbox(queue_size)
        self._redialling = _Redialling(reconnect) if reconnect else None
        self._dial = dial or partial(_dial, setup=setup or Setup())
        self._last_trouble: StreamError | None = None
        self._closing = threading.Event()
        self._changing_call = threading.Lock()
        self.reconnects = 0
        """How often the receiver called again."""
        self._call = self._dial(address, self._inbox)

    def __enter__(self) -> Self:
        """The connection is under way already."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Hangs up."""
        self.close()

    @property
    def received(self) -> int:
        """Pictures decoded so far, over all connections."""
        return self._inbox.received

    @property
    def dropped(self) -> int:
        """Pictures decoded but thrown away because the caller was slow."""
        return self._inbox.dropped

    def next_frame(self, timeout_s: float) -> Frame:
        """The oldest picture that waits, or the next one to come.

        Raises:
            NoPictureError: none came within `timeout_s` seconds; asking again is fine.
            ReceiverClosedError: somebody closed the receiver.
            StreamError: the stream was refused, ended or can't be decoded. With `reconnect`, only what
                calling again can't mend; without, the same again at every further call.
        """
        deadline_s = time.monotonic() + timeout_s
        while not self._closing.is_set():
            news = self._inbox.take(deadline_s)
            if isinstance(news, Frame):
                self._last_trouble = None
                if self._redialling:
                    self._redialling.succeeded()
                return news
            if news is None:
                raise nothing_within(self._address, timeout_s, self._last_trouble)
            if self._redialling is None or news.final:
                raise news.with_traceback(None)
            self._last_trouble = news
            due_s = self._redialling.due_s()
            if not self._closing.wait(max(0.0, min(due_s, deadline_s) - time.monotonic())):
                if deadline_s < due_s:
                    raise nothing_within(self._address, timeout_s, news)
                self._redialling.called()
                self._call_again()
        raise closed()

    def close(self) -> None:
        """Hangs up; who waits in `next_frame` gets a `ReceiverClosedError`. Closing again does nothing."""
        with self._changing_call:
            if self._closing.is_set():
                return
            self._closing.set()
            self._inbox.end(closed())
            self._call.close()

    def _call_again(self) -> None:
        with self._changing_call:
            if self._closing.is_set():
                return
            self._call.close()
            self._inbox.reopen()
            self.reconnects += 1
            self._call = self._dial(self._address, self._inbox)
