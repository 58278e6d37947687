"""What else commands the robot: the other inputs of the multiplexer, as the graph shows them.

A reset would leave the robot to a source that has gone on publishing. Behind a locked multiplexer nothing
shows that there is one; before it, its messages do.
"""

import logging
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from common.ros_node import OWN_NODES
from drive.motion.values import DISCOVERY_NS, MS, ZERO
from drive.ros.subscriptions import newest, subscribe, velocity_of

_log = logging.getLogger(__name__)

_TYPES: Final = frozenset({"geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"})
_MOST: Final = 16
"""Inputs that are listened to; any more are a mistake of the graph."""
_LOOK_EVERY_NS: Final = 500 * MS
_TAKE_EVERY_NS: Final = 100 * MS
"""Only a reset asks for it."""
_COMMANDED_NS: Final = 1_000 * MS
"""A source that has commanded motion counts as one that does for so long: twice twist_mux's usual timeout."""


class _Input:
    """One input of the multiplexer. Until it has been listened to for a while, doubt counts as motion."""

    def __init__(self, node: Any, topic: str, type_name: str, now_ns: int) -> None:
        self.subscription = subscribe(node, type_name, topic)
        self._commanded_ns = now_ns

    def commands(self, now_ns: int) -> bool:
        """Takes what has arrived; returns whether motion was commanded lately."""
        message = newest(self.subscription)
        if message is not None and velocity_of(message) != ZERO:
            self._commanded_ns = now_ns
        return now_ns - self._commanded_ns <= _COMMANDED_NS


class OtherSources:
    """Listens to the inputs of the multiplexer, without those that are ours.

    Args:
        node: of rclpy.
        outputs: topics that our velocities are published on.
        mux_output: topic on which the multiplexer publishes; None if it is not known.
    """

    def __init__(self, node: Any, outputs: Sequence[str], mux_output: str | None) -> None:
        self._began_ns = time.monotonic_ns()
        self._node = node
        self._outputs, self._mux_output = outputs, mux_output
        self._ours = {*outputs, mux_output}
        self._inputs: dict[str, _Input] = {}
        self._known: dict[str, str] = {}
        """Inputs of the newest node that was known to be the multiplexer, with their types."""
        self._missing: frozenset[str] = frozenset()
        """Those of `_known` that it did not take at the newest look."""
        self._found: dict[str, str] = {}
        """What is to be listened to: `_known`, and what a guess has found."""
        self._looked_ns = self._taken_ns = 0
        self._commanding: tuple[str, ...] = ()

    def known(self, now_ns: int, foreign_motion_ns: int) -> bool:
        """Whether there has been time enough to discover them.

        Args:
            now_ns: monotonic.
            foreign_motion_ns: when one of them last moved the base; 0 if none has. The multiplexer may have
                discovered it before it was discovered here.
        """
        return now_ns - max(self._began_ns, foreign_motion_ns) >= DISCOVERY_NS

    def commanding(self, now_ns: int) -> tuple[str, ...]:
        """Returns the topics on which motion was commanded lately.

        It names none while there has not been time enough to discover which node is the multiplexer: an
        observer may be all that is known so far, and takes more than the multiplexer does.
        """
        if now_ns - self._looked_ns >= _LOOK_EVERY_NS:
            self._looked_ns = now_ns
            self._look()
        if now_ns - self._taken_ns >= _TAKE_EVERY_NS:
            self._taken_ns = now_ns
            self._follow(now_ns)
            # All are asked, so that each takes what has arrived.
            heard = [topic for topic, each in self._inputs.items() if each.commands(now_ns)]
            early = not self._known and now_ns - self._began_ns < DISCOVERY_NS
            self._commanding = () if early else tuple(topic for topic in heard if topic in self._found)
        return self._commanding

    def _look(self) -> None:
        try:
            multiplexers, guessed = self._multiplexers()
            found = dict(self._other_inputs(multiplexers))
        except (RuntimeError, UnicodeError) as error:
            # A node that has just gone, or a name that is no text.
            _log.debug("the inputs of the multiplexer can't be listed: %s", error)
            return
        if guessed or not found:
            # A multiplexer that is started again has the inputs that it had; meanwhile a guess adds to them.
            self._missing = frozenset()
            self._found = self._known | found if found else self._found
            return
        # Its inputs are discovered one by one: what is missing now may be there at the next look.
        missing = frozenset(self._known.keys() - found.keys())
        self._known = {each: self._known[each] for each in missing - self._missing} | found
        self._missing = missing
        self._found = self._known

    def _other_inputs(self, multiplexers: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
        """Yields topic and type of each velocity that these nodes take beside ours."""
        for name, namespace in multiplexers:
            for topic, types in self._node.get_subscriber_names_and_types_by_node(name, namespace):
                if topic not in self._ours and (known := _TYPES.intersection(types)):
                    yield topic, min(known)

    def _multiplexers(self) -> tuple[set[tuple[str, str]], bool]:
        """Returns the nodes that take an output and publish what reaches the base, and whether it is a guess.

        It is one where none of those that take an output does, or where what reaches the base is not known:
        then all of them count. A node that only records takes all there is, measured velocities as well.
        """
        publishing = self._node.get_publishers_info_by_topic(self._mux_output) if self._mux_output else ()
        all_takers = [_nodes(self._node.get_subscriptions_info_by_topic(output)) for output in self._outputs]
        known = [takers & _nodes(publishing) for takers in all_takers]
        counted = [multiplexers or takers for multiplexers, takers in zip(known, all_takers, strict=True)]
        return set().union(*counted), counted != known

    def _follow(self, now_ns: int) -> None:
        """Adds an input that is missing, else removes one: each takes the middleware a few milliseconds."""
        missing = self._found.keys() - self._inputs.keys()
        if missing and len(self._inputs) < _MOST:
            topic = missing.pop()
            self._inputs[topic] = _Input(self._node, topic, self._found[topic], now_ns)
        elif surplus := self._inputs.keys() - self._found.keys():
            self._node.destroy_subscription(self._inputs.pop(surplus.pop()).subscription)


def _nodes(endpoints: Iterable[Any]) -> set[tuple[str, str]]:
    """Returns the nodes that are none of this project's, by name and namespace."""
    return {(each.node_name, each.node_namespace) for each in endpoints if each.node_name not in OWN_NODES}
