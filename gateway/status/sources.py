"""Every configured source as operators see it: whether it comes, and if not, why not."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.board import Presence, SourceKind
from gateway.status.freshness import Freshness


class SourceState(Enum):
    """What is known of a source at one instant."""

    WAITING = "waiting"
    """Nothing has come, and nobody on the robot offers it."""
    SILENT = "silent"
    """Somebody offers it, and nothing has come."""
    RECEIVING = "receiving"
    STALE = "stale"
    """It came once; the newest value is too old."""
    QOS_MISMATCH = "qos_mismatch"
    """It is offered with a quality of service that excludes ours, so nothing can come."""
    WRONG_TYPE = "wrong_type"
    """It is offered as another type than configured, so nothing can come."""
    TYPE_MISSING = "type_missing"
    """Its message type is not installed beside the gateway."""


@dataclass(frozen=True, slots=True)
class SourceView:
    """One configured source at one instant.

    Attributes:
        name: short and stable, for programs: "odometry".
        words: the same for people.
        detail: the state in a sentence; empty while all is well.
    """

    kind: SourceKind
    name: str
    words: str
    state: SourceState
    freshness: Freshness
    required: bool
    detail: str


_SENTENCES: Final[Mapping[SourceState, str]] = {
    SourceState.WAITING: "no {words} since the gateway started, and nobody on the robot offers it",
    SourceState.SILENT: "the robot offers {words}, but nothing has arrived",
    SourceState.RECEIVING: "",
    SourceState.STALE: "{words} stopped coming",
    SourceState.QOS_MISMATCH: "the robot offers {words} with delivery guarantees that exclude the gateway's",
    SourceState.WRONG_TYPE: "the robot offers {words} in another form than the gateway is configured for",
    SourceState.TYPE_MISSING: "{words} can't be read: its message type is not installed beside the gateway",
}
"""Total: every state in a sentence, free of the robot's own names."""


def words_for(name: str) -> str:
    """A source's name for people: "odometry", "commands of keyboard"."""
    kind, _, giver = name.partition(".")
    return f"commands of {giver}" if giver else kind.replace("_", " ")


def detail(state: SourceState, words: str, presence: Presence | None) -> str:
    """The state of the source that operators call `words`, in a sentence; empty while all is well."""
    if state is SourceState.RECEIVING and presence and presence.offered_by > 1:
        return f"{presence.offered_by} programs offer {words}: what is shown may be of any of them"
    if state is SourceState.STALE and presence and presence.offered_by == 0:
        return f"{words} stopped coming: nobody on the robot offers it any more"
    if state is SourceState.QOS_MISMATCH and presence:
        return f"{_SENTENCES[state].format(words=words)}: {presence.qos_mismatch}"
    return _SENTENCES[state].format(words=words)


def state_of(freshness: Freshness, presence: Presence | None, *, unusable: bool) -> SourceState:
    """The state that follows. Without `presence` nobody has looked who offers it."""
    if unusable:
        return SourceState.TYPE_MISSING
    if freshness.fresh:
        return SourceState.RECEIVING
    if presence and presence.offered_by:
        if presence.wrong_type:
            return SourceState.WRONG_TYPE
        if presence.qos_mismatch:
            return SourceState.QOS_MISMATCH
        if not freshness.available:
            return SourceState.SILENT
    return SourceState.STALE if freshness.available else SourceState.WAITING
