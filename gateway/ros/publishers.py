"""Who publishes the topic of a source, and whether the middleware connects publisher and subscription."""

import logging
import time
from collections.abc import Sequence
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, QoSCompatibility, ReliabilityPolicy, qos_check_compatible

from gateway.config import SourceSettings
from gateway.ros.subscription import qos_of
from gateway.status.board import Board, Publishers

log = logging.getLogger(__name__)

_GUARANTEES: Final = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
EXAMINE_EVERY_S: Final = 1.0
"""A poll costs about 25 us per source. Polled, because graph events need an executor that spins."""


def publishers_of(source: SourceSettings, endpoints: Sequence[Any]) -> Publishers:
    """Returns the verdict on the publishers of a source's topic, given their endpoint infos."""
    fitting = [each for each in endpoints if each.topic_type == source.type]
    mismatches = [qos_mismatch(source, each) for each in fitting]
    return Publishers(
        count=len(endpoints),
        qos_mismatch=mismatches[0] if mismatches and all(mismatches) else "",
        wrong_type=bool(endpoints) and not fitting,
    )


def qos_mismatch(source: SourceSettings, endpoint: Any) -> str:
    """Returns why the middleware does not connect the two, for people; empty if it does.

    A publisher must offer at least what the subscription requests (DDS 2.2.3, "requested / offered").
    """
    offered, requested = endpoint.qos_profile, qos_of(source)
    compatibility, reason = qos_check_compatible(offered, requested)
    if compatibility != QoSCompatibility.ERROR:
        return ""
    differences = [
        f"{_policy_name(request)} is requested, {_policy_name(offer)} is offered"
        for offer, request in (
            (offered.reliability, requested.reliability),
            (offered.durability, requested.durability),
        )
        if request in _GUARANTEES and offer not in _GUARANTEES
    ]
    return "; ".join(differences) or str(reason)


def _policy_name(policy: Any) -> str:
    return str(policy.name).lower().replace("_", " ")


class PublisherMonitor:
    """Keeps `board.publishers` current, in the sampling thread.

    Args:
        node: whose graph is examined.
        sources: those that are subscribed.
        board: where the result goes.
    """

    def __init__(self, node: Any, sources: Sequence[SourceSettings], board: Board) -> None:
        self._node, self._sources, self._board = node, tuple(sources), board
        self._due_s = 0.0
        self._failing: set[str] = set()
        """Topics whose publishers could not be examined the last time."""

    def take(self) -> None:
        """Examines the graph when it is due. Never raises."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        self._due_s = now_s + EXAMINE_EVERY_S
        for source in self._sources:
            try:
                self._update(source, self._node.get_publishers_info_by_topic(source.topic))
                self._failing.discard(source.topic)
            except Exception as error:  # noqa: BLE001  # a peer's name that is not UTF-8, a middleware's error
                # Values still arrive; only the reasons for missing ones are unknown.
                self._board.publishers.pop(source.spec, None)
                if source.topic not in self._failing:
                    log.warning("the publishers of %s can't be examined: %s", source.topic, error)
                self._failing.add(source.topic)

    def _update(self, source: SourceSettings, endpoints: Sequence[Any]) -> None:
        publishers = publishers_of(source, endpoints)
        if publishers == self._board.publishers.get(source.spec):
            return
        self._board.publishers[source.spec] = publishers
        if publishers.wrong_type:
            types = ", ".join(sorted({each.topic_type for each in endpoints}))
            log.warning("%s is published as %s, but configured as %s", source.topic, types, source.type)
        elif publishers.qos_mismatch:
            log.warning("%s can't be received: %s", source.topic, publishers.qos_mismatch)
