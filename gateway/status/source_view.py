"""The state of every configured source for operators: whether it is received, and if not, why."""

from collections.abc import Mapping
from enum import Enum
from typing import Any, Final, NamedTuple

from gateway.status.board import Publishers, Unusable
from gateway.status.freshness import Freshness
from gateway.status.sources import SourceSpec


class SourceState(Enum):
    """State of a source at one instant."""

    WAITING = "waiting"
    """Nothing was received, and it has no publisher."""
    SILENT = "silent"
    """It has a publisher, but nothing was received."""
    RECEIVING = "receiving"
    STALE = "stale"
    """The newest value is too old."""
    QOS_MISMATCH = "qos_mismatch"
    """The QoS of every publisher is incompatible with the gateway's."""
    WRONG_TYPE = "wrong_type"
    """Every publisher has another message type than configured."""
    TYPE_MISSING = "type_missing"
    """The message type is not installed beside the gateway."""
    FIELD_MISSING = "field_missing"
    """The message type is installed, but lacks the configured field, or that is of another kind."""
    UNDECODABLE = "undecodable"
    """Messages arrive, but can't be decoded: the type has the same name and other fields."""


class SourceView(NamedTuple):
    """One configured source at one instant.

    Attributes:
        detail: explains the state; empty if all is well.
        stale_since_pass: whether it is stale only since the ROS sampler last passed: that accuses no
            publisher.
    """

    spec: SourceSpec[Any]
    state: SourceState
    freshness: Freshness
    required: bool
    detail: str
    stale_since_pass: bool


_SENTENCES: Final[Mapping[SourceState, str]] = {
    SourceState.WAITING: "no {name} since the gateway started, and nothing on the robot publishes it",
    SourceState.SILENT: "the robot offers {name}, but nothing has arrived",
    SourceState.RECEIVING: "",
    SourceState.STALE: "{name} stopped coming",
    SourceState.QOS_MISMATCH: "the robot offers {name} with delivery guarantees that exclude the gateway's",
    SourceState.WRONG_TYPE: "the robot offers {name} in another form than the gateway is configured for",
    SourceState.TYPE_MISSING: "{name} can't be read: its message type is not installed beside the gateway",
    SourceState.FIELD_MISSING: "{name} can't be read: its message type has no such field, or has it in"
    " another form",
    SourceState.UNDECODABLE: "{name} arrives, but can't be decoded: the robot's message type has other fields"
    " than the one installed beside the gateway",
}
"""Total: a sentence for every state. It names no topic, node or type: those are the robot's own affair."""
_BLAMES_SILENCE: Final = frozenset({SourceState.WAITING, SourceState.SILENT, SourceState.STALE})
_NOT_READ: Final = "the gateway does not read ROS at the moment"


def source_view(
    spec: SourceSpec[Any],
    freshness: Freshness,
    publishers: Publishers | None,
    *,
    required: bool,
    unusable: Unusable | None,
    undecodable: bool,
    stale_since_pass: bool,
    sampler_late: bool,
) -> SourceView:
    """Returns the view of one source.

    Args:
        spec: the source.
        freshness: of its newest value.
        publishers: None before the graph was examined.
        required: whether the configuration requires it.
        unusable: why it is not subscribed; None if it is.
        undecodable: whether its newest message could not be decoded.
        stale_since_pass: whether it is stale only since the ROS sampler last passed.
        sampler_late: whether that was too long ago to judge by silence.
    """
    state = _state(freshness, publishers, unusable=unusable, undecodable=undecodable)
    blames_silence = sampler_late and state in _BLAMES_SILENCE
    sentence = _NOT_READ if blames_silence else detail(state, spec.display_name, publishers)
    return SourceView(spec, state, freshness, required, sentence, stale_since_pass)


def detail(state: SourceState, name: str, publishers: Publishers | None) -> str:
    """Returns the sentence on a source that people know by `name`; empty if all is well."""
    if state is SourceState.RECEIVING:
        if not publishers or publishers.count < 2:
            return ""
        return f"{publishers.count} programs publish {name}: the values shown may be from any of them"
    if state is SourceState.STALE and publishers and publishers.count == 0:
        return f"{name} stopped coming: nothing on the robot publishes it any more"
    if state is SourceState.QOS_MISMATCH and publishers:
        return f"{_SENTENCES[state].format(name=name)}: {publishers.qos_mismatch}"
    return _SENTENCES[state].format(name=name)


def _state(
    freshness: Freshness, publishers: Publishers | None, *, unusable: Unusable | None, undecodable: bool
) -> SourceState:
    if unusable:
        return SourceState.TYPE_MISSING if unusable.lacks_type else SourceState.FIELD_MISSING
    if freshness.fresh:
        return SourceState.RECEIVING
    if undecodable:
        return SourceState.UNDECODABLE
    offered = publishers is not None and publishers.count > 0
    if publishers and offered and (publishers.wrong_type or publishers.qos_mismatch):
        return SourceState.WRONG_TYPE if publishers.wrong_type else SourceState.QOS_MISMATCH
    if freshness.available:
        return SourceState.STALE
    return SourceState.SILENT if offered else SourceState.WAITING
