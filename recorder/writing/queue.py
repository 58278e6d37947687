"""Between what takes messages and what writes them: bounded in bytes, with a rule when it is full."""

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from recorder.values import VIDEO_TOPIC, Channel, Ended, GapCause, Item, Loss, Note, Sample

_OVERHEAD_BYTES: Final = 256
"""Of a message's objects in memory, roughly."""
MAX_NOTES: Final = 256
"""Beyond the bound in bytes: changes of the video's stream come by the second, some hundred bytes each."""
LEFT_OUT: Final = "notes_left_out"
"""Key of a note that stands for others as well: how many."""


class SampleQueue:
    """Takes messages from any thread and hands them to one that writes.

    When it is full, the new messages are dropped, and one Loss for each of their channels follows as soon
    as the writer has caught up. After a frame of the video those that follow it are dropped as well, up to
    the next one at which a decoder can begin: without it they would be decoded into wrong pictures. Their
    Loss follows then, so that it is one. Losses of others are merged by channel and cause meanwhile. Notes
    have room of their own; when that is full, too, the newest of each name is kept, and says how many it has
    replaced.

    Args:
        max_bytes: what waits at most.

    Attributes:
        dropped: messages dropped so far.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._items: deque[Item] = deque()
        self._bytes = 0
        self._losses: dict[tuple[Channel | None, GapCause], Loss] = {}
        self._beyond = 0
        """Notes among the items, beyond the bound in bytes."""
        self._notes: dict[str, tuple[Note, int]] = {}
        """Beyond that as well: the newest of each name, and how many it has replaced."""
        self._changed = threading.Condition()
        self._woken = False
        self._awaits_key_frame = False
        """Whether a frame of the video was dropped, and none has come since at which a decoder can begin."""
        self._held: Loss | None = None
        """The frames dropped so far, while it waits for that one."""
        self.dropped = 0

    def put(self, items: Sequence[Item]) -> None:
        """Appends items in order; never waits."""
        with self._changed:
            for item in items:
                self._put(item)
            self._changed.notify()

    def wake(self) -> None:
        """Ends a `take` that waits, or the next one."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    def take(self, timeout_s: float, *, so_far: bool = False) -> list[Item]:
        """Returns what waits, in order; empty after `timeout_s` without anything, or after `wake`.

        Args:
            timeout_s: to wait at most.
            so_far: whether a loss of the video that lasts is returned, too: what it belongs to may end.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._losses or self._woken, timeout_s)
            self._woken = False
            if so_far:
                self._end_held()
            notes = (_standing_for(count, note) for note, count in self._notes.values())
            taken = [*self._items, *notes, *self._losses.values()]
            self._items.clear()
            self._notes.clear()
            self._losses.clear()
            self._bytes = self._beyond = 0
        return taken

    def _put(self, item: Item) -> None:
        size = _OVERHEAD_BYTES + (len(item.data) if isinstance(item, Sample) else 0)
        is_frame = isinstance(item, Sample) and item.channel.topic == VIDEO_TOPIC
        cut_off = isinstance(item, Sample) and item.follows and self._awaits_key_frame
        # One message may be larger than the whole queue.
        if not cut_off and (not self._items or self._bytes + size <= self._max_bytes):
            self._items.append(item)
            self._bytes += size
            if is_frame and self._awaits_key_frame:
                self._awaits_key_frame = False
                self._end_held()
        elif isinstance(item, Sample):
            self.dropped += 1
            at_ns = item.log_time_ns
            loss = Loss(item.channel, GapCause.QUEUE, at_ns, at_ns, 1)
            if is_frame:
                self._awaits_key_frame = True
                self._held = merged(self._held, loss) if self._held else loss
            else:
                self._merge(loss)
        elif isinstance(item, Loss):
            self._merge(item)
        elif isinstance(item, Ended):
            self._items.append(item)  # There is at most one for each subscription.
        elif self._beyond < MAX_NOTES:
            self._items.append(item)
            self._beyond += 1
        else:
            _, replaced_by_former = self._notes.get(item.name, (item, -1))
            self._notes[item.name] = item, replaced_by_former + 1

    def _end_held(self) -> None:
        if self._held:
            self._merge(self._held)
            self._held = None

    def _merge(self, loss: Loss) -> None:
        key = loss.channel, loss.cause
        before = self._losses.get(key)
        self._losses[key] = merged(before, loss) if before else loss


def _standing_for(others: int, note: Note) -> Note:
    """Returns the note, with the number of those that it has replaced."""
    return replace(note, values={**note.values, LEFT_OUT: str(others)}) if others else note


def merged(first: Loss, second: Loss) -> Loss:
    """Returns one loss for two of the same channel and cause, which spans both."""
    unknown = first.messages is None or second.messages is None
    return replace(
        first,
        began_ns=min(first.began_ns, second.began_ns),
        ended_ns=max(first.ended_ns, second.ended_ns),
        messages=None if unknown else (first.messages or 0) + (second.messages or 0),
    )
