"""Between the thread that receives a stream and the caller who takes its time: bounded, never a backlog."""

import threading
import time
from collections import deque
from typing import Final, Generic, TypeVar

from console.client.errors import DeadlineExceeded, GatewayError

ItemT = TypeVar("ItemT")

MOST_WAITING: Final = 64
"""Items of a stream in which none may be left out; when so many wait, the gateway is not read on."""


class Mailbox(Generic[ItemT]):
    """One writer, one reader.

    Args:
        newest_only: whether a new item takes the place of one that was not read yet.
    """

    def __init__(self, *, newest_only: bool) -> None:
        self._newest_only = newest_only
        self._items: deque[ItemT] = deque(maxlen=1 if newest_only else None)
        self._ended_with: GatewayError | None = None
        self._abandoned = False
        self._changed = threading.Condition()

    def put(self, item: ItemT) -> bool:
        """Waits for room where nothing may be left out; False when nobody will read any more."""
        with self._changed:
            while not self._newest_only and len(self._items) >= MOST_WAITING and not self._abandoned:
                self._changed.wait()
            self._items.append(item)
            self._changed.notify_all()
            return not self._abandoned

    def end(self, error: GatewayError) -> None:
        """No more comes, because of this."""
        with self._changed:
            self._ended_with = error
            self._changed.notify_all()

    def abandon(self) -> None:
        """Nobody reads any more: the writer is let go."""
        with self._changed:
            self._abandoned = True
            self._changed.notify_all()

    def get(self, within_s: float) -> ItemT | GatewayError:
        """The next item; after the last one, what ended the stream; or DeadlineExceeded."""
        until_s = time.monotonic() + within_s
        with self._changed:
            while not self._items:
                if self._ended_with is not None:
                    return self._ended_with
                left_s = until_s - time.monotonic()
                if left_s <= 0:
                    return DeadlineExceeded(f"the robot gateway sent nothing for {within_s:.1f} s")
                self._changed.wait(left_s)
            item = self._items.popleft()
            self._changed.notify_all()
            return item
