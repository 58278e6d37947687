"""Serialised responses of the polled methods, shared by all callers that ask within a moment.

Tools of the locked contract poll, ten times a second each: computing and serialising the same status for
every one would be most of the gateway's work. A response is reused for REUSE_S at most, so no age in it is
wrong by more. A preview that changes makes a new one at once: a caller that has just switched it sees that.
So does a pass of the ROS sampler, 20 of them a second: no value of a topic waits once more here.
"""

from collections.abc import Callable
from typing import Final, TypeAlias

from google.protobuf.message import Message

from gateway.rpc.calls.ports import StatusSource
from gateway.rpc.calls.recipient import Recipient
from gateway.status.snapshot import Snapshot

REUSE_S: Final = 0.01

Build: TypeAlias = Callable[[Snapshot, Recipient], Message]
"""A mapping of gateway/rpc/mapping."""


class ResponseCache:
    """The newest responses, by mapping and recipient.

    Args:
        state: where snapshots come from.
        clock: seconds, monotonic; the one that snapshots are dated by.
    """

    def __init__(self, state: StatusSource, clock: Callable[[], float]) -> None:
        self._state = state
        self._clock = clock
        self._passed_s = state.ros_passed_s
        self._snapshot = state.snapshot()
        self._responses: dict[tuple[Build, Recipient], bytes] = {}

    def response(self, build: Build, recipient: Recipient) -> bytes:
        """Returns what `build` makes of a snapshot of this instant, serialised."""
        if self._outdated():
            # Before the snapshot: a pass that ends while that is taken makes another one.
            self._passed_s = self._state.ros_passed_s
            self._snapshot = self._state.snapshot()
            self._responses.clear()
        key = (build, recipient)
        response = self._responses.get(key)
        if response is None:
            response = self._responses[key] = build(self._snapshot, recipient).SerializeToString()
        return response

    def _outdated(self) -> bool:
        expired = self._clock() - self._snapshot.at_s > REUSE_S
        changed = self._state.preview is not self._snapshot.preview
        return expired or changed or self._state.ros_passed_s != self._passed_s
