"""Whether anything but this project's own observers takes the velocities, on each leg of their way."""

import logging
from collections.abc import Container, Sequence
from typing import Any, Final, Protocol

from drive.motion.values import MS

_log = logging.getLogger(__name__)

_LOOK_EVERY_NS: Final = 500 * MS
"""At the graph: who subscribes."""
_COUNT_EVERY_NS: Final = 100 * MS
"""How many do behind the multiplexer: rclpy expands and validates the name of the topic each time."""


class MatchedPublisher(Protocol):
    """The publisher of the velocities (drive.ros.base.VelocityPublisher)."""

    def matched(self) -> int:
        """Returns how many subscriptions take the velocities, observers included."""


class Takers:
    """What takes the velocities of one publisher.

    Args:
        node: of rclpy.
        velocities: the publisher.
        outputs: topics that it publishes on.
        mux_output: topic on which the velocities reach the base; None if it is not known.
        observers: names of nodes that only look at velocities.
    """

    def __init__(
        self,
        node: Any,
        velocities: MatchedPublisher,
        outputs: Sequence[str],
        mux_output: str | None,
        observers: Container[str],
    ) -> None:
        self._node = node
        self._velocities = velocities
        self._outputs = outputs
        self._mux_output = mux_output
        self._observers = observers
        self._counts: tuple[int, int] | None = None
        self._taken = False, False
        self._observing = 0
        """How many subscriptions of the outputs are an observer's."""
        self._reached = False
        self._looked_ns = 0
        self._behind_mux = 0
        self._count_due_ns = 0

    def problems(self, now_ns: int) -> list[str]:
        """Returns what is missing; looking closely only when a count has changed, and now and then."""
        counts = self._velocities.matched(), self._count_behind_mux(now_ns)
        if counts != self._counts or now_ns - self._looked_ns >= _LOOK_EVERY_NS:
            self._counts, self._looked_ns = counts, now_ns
            self._look()
        problems = []
        if not self._reaches(counts[0]):
            problems.append(f"nothing takes the velocities on {', '.join(self._outputs)}")
        if self._mux_output and not (counts[1] and self._taken[1]):
            problems.append(f"no base takes the velocities on {self._mux_output}")
        return problems

    def _reaches(self, matched: int) -> bool:
        """Returns whether the velocities arrive at anything but observers.

        The graph may list what has not been matched yet, and what is matched may be an observer. What has
        once been reached stays so while it is listed: an observer that leaves is matched and listed for
        different lengths of time, and must not stop the robot.
        """
        taken = matched > 0 and self._taken[0]
        self._reached = taken and (self._reached or matched > self._observing)
        return self._reached

    def _look(self) -> None:
        """Looks at the graph, closely."""
        outputs = [self._names(topic) for topic in self._outputs]
        behind = self._names(self._mux_output) if self._mux_output else []
        self._taken = any(map(self._is_taken, outputs)), self._is_taken(behind)
        self._observing = sum(name in self._observers for names in outputs for name in names or ())

    def _count_behind_mux(self, now_ns: int) -> int:
        if self._mux_output and now_ns >= self._count_due_ns:
            self._count_due_ns = now_ns + _COUNT_EVERY_NS
            self._behind_mux = int(self._node.count_subscribers(self._mux_output))
        return self._behind_mux

    def _names(self, topic: str) -> list[str] | None:
        """Returns the nodes that subscribe to a topic; None if they can't be listed."""
        try:
            found = self._node.get_subscriptions_info_by_topic(topic)
        except (RuntimeError, UnicodeError) as error:
            # A program that announces a name that is no text; then all that is known is their number.
            _log.debug("the subscribers of %s can't be listed: %s", topic, error)
            return None
        return [each.node_name for each in found]

    def _is_taken(self, names: list[str] | None) -> bool:
        """Returns whether one of the nodes is no observer; unknown ones count as none."""
        return names is None or any(name not in self._observers for name in names)
