"""Everything between the ROS 2 graph and the queue, as one `with` block.

| in the graph | done |
|---|---|
| a topic appears late | a channel from then on |
| its type changes | another channel, after what the former one has lost |
| it has two types at a time | the first is recorded; a problem. A DDS participant knows one type of a topic |
| its publishers go | the subscription stays for half a minute, for those that come back |
| publishers with another QoS join | a second subscription that fits all, then the end of the first |
| all of them have become transient local | another channel, with whose messages later segments begin |
| the type is not installed | the topic is left out; a problem that names the package |
| a name that is no ROS name, more than 1000 topics | left out |
| a name that is not UTF-8 | the topics of the other nodes go on; losses are unknown meanwhile |
| a message can't be taken | the topic is tried again in each pass; the others go on |
"""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from common.receive_time import Instant, present_instant
from common.ros_node import OwnNode, TypeMissingError, message_class, ros_node
from common.sampler import SAMPLING_HZ, Sampler
from recorder.intake.qos import is_latched, offered_qos
from recorder.intake.schemas import ENCODING, Schemas
from recorder.intake.source import Source
from recorder.intake.topics import Selects, selected
from recorder.values import Channel, Ended, Item

_log = logging.getLogger(__name__)

EXAMINE_EVERY_S: Final = 1.0
"""How often the graph is examined: a topic is recorded at the latest so long after it appears."""
GONE_AFTER_S: Final = 30.0
"""A subscription without publishers ends."""
_MAX_PROBLEMS: Final = 100
_MAX_KNOWN: Final = 2000
"""Channels that are remembered, in case their topics come back."""

Put = Callable[[Sequence[Item]], None]
_Key = tuple[str, str]
"""Topic and type."""


@contextmanager
def intake(presets: Mapping[str, Selects], put: Put, *, rate_hz: float = SAMPLING_HZ) -> Iterator["Intake"]:
    """Takes the messages of the wanted presets until the block ends; entering and leaving take about 0.1 s.

    Args:
        presets: by name.
        put: takes messages and losses, in order; called by the sampling thread, and must not wait.
        rate_hz: how often subscriptions are emptied.

    Raises:
        UserError: rclpy is missing or can't start.
        TimeoutError: the thread hangs in the middleware at the end.
    """
    with ros_node(OwnNode.RECORDER) as node:
        taking = Intake(node, presets, put)
        with Sampler([taking], taking, rate_hz):
            yield taking


@dataclass(slots=True)
class _Entry:
    source: Source
    published_at_s: float
    """When it last had publishers."""


class Intake:
    """The subscriptions, emptied by one thread. Attributes may be read by any.

    Attributes:
        ros_passed_s: monotonic time of the end of the newest pass.
        caught_up: the newest ticket of `catch_up` that has been served.
        topics: those that are subscribed.
        problems: by topic, for people: what keeps it from being recorded. Of the graph as a whole: "".
    """

    def __init__(self, node: Any, presets: Mapping[str, Selects], put: Put) -> None:
        self._node, self._presets, self._put = node, presets, put
        self._wanted: frozenset[str] = frozenset()
        self._examined: frozenset[str] = frozenset()
        self._examine_at_s = 0.0
        self._entries: dict[_Key, _Entry] = {}
        self._channels: dict[_Key, Channel] = {}
        self._schemas = Schemas()
        self._found: dict[str, str] = {}
        """Problems since the graph was last examined."""
        self._ticket = 0
        self.caught_up = 0
        self.ros_passed_s: float | None = time.monotonic()
        self.topics: tuple[str, ...] = ()
        self.problems: Mapping[str, str] = {}

    def want(self, presets: frozenset[str]) -> None:
        """Takes the topics of these presets from the next pass on, and no others. From any thread."""
        self._wanted = presets

    def catch_up(self) -> int:
        """Requests a report of all losses so far; returns a ticket, which `caught_up` reaches then.

        By then everything that had come before is in the queue, too. For one other thread.
        """
        self._ticket += 1
        return self._ticket

    def take(self) -> None:
        """Makes one pass: empties all subscriptions, and examines the graph when it is due."""
        ticket = self._ticket
        now = present_instant()
        wanted = self._wanted
        for entry in self._entries.values():
            self._empty(entry, now)
        due = now.monotonic_s >= self._examine_at_s or ticket != self.caught_up
        if wanted != self._examined or due:
            self._examine_at_s, self._examined = now.monotonic_s + EXAMINE_EVERY_S, wanted
            self._examine(wanted, now)
            self._report()
        self.caught_up = ticket

    def _empty(self, entry: _Entry, now: Instant) -> None:
        topic = entry.source.channel.topic
        try:
            samples = entry.source.take(now)
        except Exception as error:  # noqa: BLE001  # whatever it is: the other topics are taken all the same
            self._found[topic] = f"{topic} can't be taken: {type(error).__name__}: {error}"
        else:
            if samples:
                self._put(samples)

    def _examine(self, wanted: frozenset[str], now: Instant) -> None:
        if not wanted:
            # No output takes what they have lost.
            self._close(list(self._entries))
            return
        try:
            found = selected(self._node, self._presets, wanted)
        except Exception as error:  # noqa: BLE001  # what other programs announce can be anything
            self._found[""] = f"the topics can't be listed: {type(error).__name__}: {error}"
            for entry in self._entries.values():
                # All the same: what a source keeps of its messages until it is asked grows with each.
                if loss := entry.source.lost(None):
                    self._put([loss])
            return
        if found.problem:
            self._found[""] = found.problem
        self._end([key for key in self._entries if not self._is_wanted(key, wanted)], now)
        for key, presets in found.presets.items():
            self._update(key, presets, now)
        self._end(
            [
                key
                for key, entry in self._entries.items()
                if now.monotonic_s - entry.published_at_s > GONE_AFTER_S
            ],
            now,
        )

    def _is_wanted(self, key: _Key, wanted: frozenset[str]) -> bool:
        return bool(self._channels[key].presets & wanted)

    def _update(self, key: _Key, presets: frozenset[str], now: Instant) -> None:
        topic, type_name = key
        offers = self._offers(key)
        entry = self._entries.get(key)
        loss = None
        try:
            if entry is None and (offers or offers is None):
                self._make_way(key, now)
                entry = self._entries[key] = _Entry(
                    self._open(key, presets, offers or (), now), now.monotonic_s
                )
            if entry is None:
                return
            if offers or offers is None:
                entry.published_at_s = now.monotonic_s
            loss = entry.source.update(offers, now)
            self._channels[key] = entry.source.channel
        except TypeMissingError as error:
            self._found[topic] = str(error)
        except Exception as error:  # noqa: BLE001  # the other topics are recorded all the same
            self._found[topic] = (
                f"{topic} can't be subscribed as {type_name}: {type(error).__name__}: {error}"
            )
            # The subscription that there is goes on, and so does the count of what it loses.
            loss = entry.source.lost(offers) if entry else None
        if loss:
            self._put([loss])

    def _make_way(self, key: _Key, now: Instant) -> None:
        """Ends the subscription to another type of the topic that has no publishers any more.

        Raises:
            TypeMissingError: it has some.
        """
        topic, type_name = key
        for other in [each for each in self._entries if each[0] == topic]:
            if self._offers(other):
                raise TypeMissingError(
                    f"{topic} is published as {type_name}, too: it is recorded as {other[1]} alone"
                )
            self._end([other], now)

    def _offers(self, key: _Key) -> Sequence[Any] | None:
        """Returns the endpoints that publish this topic with this type; None if they can't be examined."""
        topic, type_name = key
        try:
            endpoints = self._node.get_publishers_info_by_topic(topic)
        except Exception:  # noqa: BLE001  # a peer's name that is not UTF-8, a middleware's error
            return None
        return [each for each in endpoints if each.topic_type == type_name]

    def _open(self, key: _Key, presets: frozenset[str], offers: Sequence[Any], now: Instant) -> Source:
        topic, type_name = key
        # First, because it checks the name: it comes from the graph, and importing it would run any package.
        schema = self._schemas.of(type_name)
        message_type = message_class(type_name)
        channel = self._channels.get(key)
        if channel is None or channel.latched != is_latched(offers):
            channel = Channel(
                topic=topic,
                type=type_name,
                schema=schema,
                schema_encoding=ENCODING,
                offered_qos=offered_qos(offers),
                latched=is_latched(offers),
                presets=presets,
            )
        source = Source(self._node, message_type, channel, offers, now)
        self._channels[key] = channel
        _log.info("%s is recorded as %s", topic, type_name)
        return source

    def _end(self, keys: Sequence[_Key], now: Instant) -> None:
        """Closes subscriptions, after what they still had and have lost since they were looked at."""
        for key in keys:
            entry = self._entries[key]
            self._empty(entry, now)
            if loss := entry.source.lost(self._offers(key)):
                self._put([loss])
        self._close(keys)

    def _close(self, keys: Sequence[_Key]) -> None:
        for key in keys:
            source = self._entries.pop(key).source
            source.close()
            if source.channel.latched:
                self._put([Ended(source.channel)])
        if keys:
            # Channels of topics that come back stay the same, but names are not collected for ever.
            for key in list(self._channels)[: max(0, len(self._channels) - _MAX_KNOWN)]:
                if key not in self._entries:
                    del self._channels[key]

    def _report(self) -> None:
        """Makes the problems known, and logs those that are new."""
        kept = dict(list(self._found.items())[:_MAX_PROBLEMS])
        self._found.clear()
        for topic, text in kept.items():
            if self.problems.get(topic) != text:
                _log.warning("%s", text)
        self.problems = kept
        self.topics = tuple(sorted({topic for topic, _ in self._entries}))
