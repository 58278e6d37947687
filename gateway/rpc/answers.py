"""Ready answers: what everybody asks for is computed and serialised once, and given to all who ask in time.

An operator's screen asks ten times a second, ten screens a hundred times; a robot's computer has better
things to do than to serialise the same status again and again. An answer is used for REUSE_S at most, so no
age in it is wrong by more. A preview that changes makes a new one at once: whoever has just switched it sees
that.
"""

from collections.abc import Callable
from typing import Final

from google.protobuf.message import Message

from gateway.rpc.caller import Caller
from gateway.rpc.mapping.status import overlay_snapshot, system_status
from gateway.status.preview import PreviewView
from gateway.status.snapshot import Snapshot

REUSE_S: Final = 0.005


class Answers:
    """The newest serialised answers of both reading methods.

    Args:
        take: makes a snapshot of this instant.
        preview: the preview of this instant, a new object whenever it changed.
        clock: seconds, monotonic; the one that snapshots are dated by.
    """

    def __init__(
        self, take: Callable[[], Snapshot], preview: Callable[[], PreviewView], clock: Callable[[], float]
    ) -> None:
        self._take = take
        self._preview = preview
        self._clock = clock
        self._snapshot = take()
        self._ready: dict[tuple[Callable[[Snapshot, Caller], Message], Caller], bytes] = {}

    def system_status(self, caller: Caller) -> bytes:
        """A serialised SystemStatus."""
        return self._answer(system_status, caller)

    def overlay_snapshot(self, caller: Caller) -> bytes:
        """A serialised OverlaySnapshot."""
        return self._answer(overlay_snapshot, caller)

    def _answer(self, build: Callable[[Snapshot, Caller], Message], caller: Caller) -> bytes:
        if self._clock() - self._snapshot.at_s > REUSE_S or self._preview() is not self._snapshot.preview:
            self._snapshot = self._take()
            self._ready.clear()
        key = (build, caller)
        answer = self._ready.get(key)
        if answer is None:
            answer = self._ready[key] = build(self._snapshot, caller).SerializeToString()
        return answer
