"""One channel at work: its subscription, emptied without waiting, and replaced without losing a message."""

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any, Final

from rclpy.qos import DurabilityPolicy

from common.receive_time import Instant, received_at
from common.ros_node import subscribe_raw
from recorder.intake.loss import Kind, LossCounter
from recorder.intake.qos import FIRST_DEPTH, MAX_BYTES, depth_for, is_latched, offered_qos, profile_of
from recorder.values import Channel, GapCause, Loss, Sample

OVERLAP_S: Final = 1.0
"""The old and the new subscription run side by side for so long: discovery takes some tenths of a second."""
_HISTORY_S: Final = 10.0
"""For so long after that, a message that is older than what is known may be history: discovery was slow."""
_MEASURED_S: Final = 1.0
_TOLERANCE: Final = 1.25
"""A queue too short by this factor, or beyond its bound in bytes, is replaced."""
_REMEMBERED: Final = 50_000
"""Messages by which repetitions are recognised: those of the overlap, at up to 50 kHz."""
_NS_PER_S: Final = 1e9

_Key = tuple[int, int]
"""Source time and number of a message: the same in both subscriptions."""


class Source:
    """Takes the messages of one channel. For the sampling thread.

    Args:
        node: whose subscriptions these are.
        message_type: the channel's class.
        channel: what the messages belong to.
        offers: endpoints of its publishers.
        now: the present instant: no message is older, unless it was latched.

    Attributes:
        channel: what the messages belong to now: another one once all publishers are transient local.

    Raises:
        TypeMissingError: the type support can't be loaded.
    """

    def __init__(
        self, node: Any, message_type: Any, channel: Channel, offers: Sequence[Any], now: Instant
    ) -> None:
        self._node, self._message_type, self.channel = node, message_type, channel
        self._depth = FIRST_DEPTH
        self._profile = profile_of(offers, self._depth)
        self._subscription = subscribe_raw(node, message_type, channel.topic, self._profile)
        self._next: Any = None
        self._switch_at_s = 0.0
        self._emptied_at_s = now.monotonic_s
        self._loss = LossCounter()
        self._recent: dict[_Key, None] = {}
        self._newest_ns = 0
        """Source time of the newest message."""
        self._history_until_ns: int | None = None
        """What the next subscription has up to this source time may be history, whose numbers begin anew.

        None if it has no history.
        """
        self._withheld: dict[_Key, None] = {}
        """Messages that were set aside for it: they were live if they come by the present one, too."""
        self._history_ends_at_s: float | None = None
        """Until when what the present subscription has may be history; None if it is none."""
        self._measured_from_s = now.monotonic_s
        self._messages = self._bytes = 0

    def take(self, now: Instant) -> list[Sample]:
        """Returns the messages that have come since the last call. Never waits.

        Raises:
            Exception: rclpy's; nothing has been taken.
        """
        present, following = self._drain_both(now)
        self._count(self._uncounted(present), maybe_history=self._history_ends_at_s is not None)
        if self._history_ends_at_s is not None and now.monotonic_s >= self._history_ends_at_s:
            self._history_ends_at_s = None
        samples = self._fresh(present)
        if self._next:
            more = self._fresh(following)
            switches = now.monotonic_s >= self._switch_at_s
            if switches:
                self._count(more, maybe_history=self._history_until_ns is not None)
            else:
                self._count_following(more)
            samples += more
            if switches:
                self._switch(now)
        self._bytes += sum(len(each.data) for each in samples)
        self._messages += len(samples)
        self._emptied_at_s = now.monotonic_s
        if samples and self.channel.latched:
            # Afterwards: DDS discovers a publisher before its first message comes.
            publishers = self._node.count_publishers(self.channel.topic)
            samples = [replace(each, publishers=publishers) for each in samples]
        return samples

    def update(self, offers: Sequence[Any] | None, now: Instant) -> Loss | None:
        """Adapts the subscription to the publishers and to their rate; returns what has been lost.

        Args:
            offers: endpoints of the publishers; None if unknown.
            now: the present instant.
        """
        self._adapt(offers, now)
        return self.lost(offers)

    def lost(self, offers: Sequence[Any] | None) -> Loss | None:
        """Returns what has been lost since the last call, or `update`.

        Args:
            offers: endpoints of the publishers; None if unknown.
        """
        publishers: frozenset[Hashable] | None = None
        if offers is not None:
            publishers = frozenset(tuple(each.endpoint_gid) for each in offers)
        lost = self._loss.collect(publishers)
        if lost is None:
            return None
        return Loss(self.channel, GapCause.MIDDLEWARE, lost.began_ns, lost.ended_ns, lost.messages)

    def close(self) -> None:
        """Ends the subscription."""
        for each in (self._subscription, self._next):
            if each:
                self._node.destroy_subscription(each)
        self._next = None

    def _adapt(self, offers: Sequence[Any] | None, now: Instant) -> None:
        measured_s = now.monotonic_s - self._measured_from_s
        if self._next or measured_s < _MEASURED_S:
            return
        depth = self._depth
        if self._messages:
            mean_bytes = self._bytes / self._messages
            fitting = depth_for(self._messages / measured_s, mean_bytes)
            if fitting > _TOLERANCE * depth or depth * mean_bytes > _TOLERANCE * MAX_BYTES:
                depth = fitting
        self._measured_from_s, self._messages, self._bytes = now.monotonic_s, 0, 0
        profile = profile_of(offers, depth) if offers else self._profile
        changed = (profile.reliability, profile.durability) != (
            self._profile.reliability,
            self._profile.durability,
        )
        if changed or depth != self._depth:
            self._next = subscribe_raw(self._node, self._message_type, self.channel.topic, profile)
            self._profile, self._depth = profile, depth
            if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                # By this machine's clock, or by that of a publisher on another one whose clock is ahead.
                self._history_until_ns = max(self._newest_ns, now.system_ns)
            self._switch_at_s = now.monotonic_s + OVERLAP_S
            if offers and is_latched(offers) and not self.channel.latched:
                # Before its history comes, which later segments are to begin with.
                self.channel = replace(self.channel, latched=True, offered_qos=offered_qos(offers))

    def _count(self, samples: Sequence[Sample], *, maybe_history: bool) -> None:
        kind = Kind.MAYBE_HISTORY if maybe_history else Kind.LIVE
        for each in samples:
            self._loss.take(each.sequence, each.log_time_ns, each.publish_time_ns, kind)
            self._newest_ns = max(self._newest_ns, each.publish_time_ns)

    def _count_following(self, samples: Sequence[Sample]) -> None:
        """Counts what the next subscription has, and sets aside what may be history."""
        until_ns = self._history_until_ns
        if until_ns is None:
            self._count(samples, maybe_history=False)
            return
        withheld = [each for each in samples if each.publish_time_ns <= until_ns]
        for each in withheld:
            # It may be live, and the queue of the present subscription too full for it.
            self._loss.take(each.sequence, each.log_time_ns, each.publish_time_ns, Kind.ASIDE)
        _remember(self._withheld, withheld)
        self._count([each for each in samples if each.publish_time_ns > until_ns], maybe_history=True)

    def _uncounted(self, samples: list[Sample]) -> list[Sample]:
        """Returns those of the present subscription that were not counted when the next one had them."""
        if not self._recent:
            return samples  # as on every topic that is neither latched nor has a next subscription
        return [each for each in samples if (key := _key(each)) not in self._recent or key in self._withheld]

    def _switch(self, now: Instant) -> None:
        self._node.destroy_subscription(self._subscription)
        self._subscription, self._next = self._next, None
        self._history_ends_at_s = None
        if self._history_until_ns is not None:
            self._history_ends_at_s = now.monotonic_s + _HISTORY_S
        self._history_until_ns = None
        self._withheld.clear()
        if not self.channel.latched:
            self._recent.clear()

    def _drain_both(self, now: Instant) -> tuple[list[Sample], list[Sample]]:
        present = self._drain(self._subscription, now)
        try:
            following = self._drain(self._next, now) if self._next else []
        except Exception:
            if not present:
                raise
            following = []  # it will be raised again, when nothing can be lost by it
        return present, following

    def _drain(self, subscription: Any, now: Instant) -> list[Sample]:
        samples: list[Sample] = []
        for _ in range(self._depth):
            try:
                taken = subscription.handle.take_message(self._message_type, True)
            except Exception:
                if samples:
                    break  # it will be raised again, when nothing can be lost by it
                raise
            if taken is None:
                break
            data, info = taken
            samples.append(self._sample(data, info, now))
        return samples

    def _fresh(self, samples: list[Sample]) -> list[Sample]:
        """Returns the samples without those that came by the other subscription, or as history once more."""
        if not (self._next or self.channel.latched):
            return samples
        fresh = [each for each in samples if _key(each) not in self._recent]
        _remember(self._recent, fresh)
        return fresh

    def _sample(self, data: bytes, info: dict[str, Any], now: Instant) -> Sample:
        received_ns = info["received_timestamp"]
        return Sample(
            channel=self.channel,
            data=data,
            log_time_ns=received_ns,
            publish_time_ns=info["source_timestamp"],
            sequence=info["publication_sequence_number"] or 0,
            monotonic_ns=int(received_at(received_ns, now, self._emptied_at_s) * _NS_PER_S),
        )


def _key(sample: Sample) -> _Key:
    return sample.publish_time_ns, sample.sequence


def _remember(keys: dict[_Key, None], samples: Sequence[Sample]) -> None:
    """Adds the keys of samples, and forgets the oldest beyond the bound."""
    keys.update(dict.fromkeys(map(_key, samples)))
    while len(keys) > _REMEMBERED:
        del keys[next(iter(keys))]
