"""Who publishes what a source reads, and whether the middleware brings them together."""

import logging
import time
from collections.abc import Sequence
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, QoSCompatibility, ReliabilityPolicy, qos_check_compatible

from gateway.config import SourceSettings
from gateway.ros.subscribing import qos_of
from gateway.status.board import Board, Presence

log = logging.getLogger(__name__)

_GUARANTEES: Final = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
LOOK_EVERY_S: Final = 1.0
"""A look costs about 25 us for each source. Changes are told only to who spins, and nobody does."""


def presence_of(source: SourceSettings, publishers: Sequence[Any]) -> Presence:
    """What follows from the publishers of a source's topic, as the node's graph tells them."""
    fitting = [each for each in publishers if each.topic_type == source.type]
    mismatches = [qos_mismatch(source, each) for each in fitting]
    return Presence(
        offered_by=len(publishers),
        qos_mismatch=mismatches[0] if mismatches and all(mismatches) else "",
        wrong_type=bool(publishers) and not fitting,
    )


def qos_mismatch(source: SourceSettings, publisher: Any) -> str:
    """Why the middleware does not connect the two, in words; empty when it does."""
    offered, asked = publisher.qos_profile, qos_of(source)
    compatibility, reason = qos_check_compatible(offered, asked)
    if compatibility != QoSCompatibility.ERROR:
        return ""
    differences = [
        f"{_words(wish)} is asked for, {_words(offer)} is offered"
        for offer, wish in ((offered.reliability, asked.reliability), (offered.durability, asked.durability))
        if wish in _GUARANTEES and offer not in _GUARANTEES
    ]
    return "; ".join(differences) or str(reason)


def _words(policy: Any) -> str:
    """RELIABLE, TRANSIENT_LOCAL: as people write it."""
    return str(policy.name).lower().replace("_", " ")


class PresenceWatch:
    """Keeps `board.presence` true, in the sampling thread.

    Args:
        node: whose graph is looked at.
        sources: those that can be read.
        board: where it is told.
    """

    def __init__(self, node: Any, sources: Sequence[SourceSettings], board: Board) -> None:
        self._node, self._sources, self._board = node, tuple(sources), board
        self._due_s = 0.0
        self._blind = False

    def take(self) -> None:
        """Looks at the graph when it is time. Never raises."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        self._due_s = now_s + LOOK_EVERY_S
        try:
            for source in self._sources:
                self._tell(source, self._node.get_publishers_info_by_topic(source.topic))
            self._blind = False
        except RuntimeError as error:
            # The middleware's own; values still come, only the reasons why others do not are missing.
            self._board.presence.clear()
            if not self._blind:
                log.warning("the ROS graph can't be looked at: %s", error)
            self._blind = True

    def _tell(self, source: SourceSettings, publishers: Sequence[Any]) -> None:
        presence = presence_of(source, publishers)
        if presence == self._board.presence.get(source.name):
            return
        self._board.presence[source.name] = presence
        if presence.wrong_type:
            types = ", ".join(sorted({each.topic_type for each in publishers}))
            log.warning("%s is published as %s, configured is %s", source.topic, types, source.type)
        elif presence.qos_mismatch:
            log.warning("%s can't be received: %s", source.topic, presence.qos_mismatch)
