"""The newest messages of transient local topics, which each segment begins with. Pure.

Messages carry no publisher, so that one publisher's message must not be taken for another's: what it replaced
would be missing from every segment that begins later. While the topic has more publishers than messages are
kept, a message may be the first of its publisher and replaces none but its own repetition. Otherwise it
replaces the one that its number follows, or, of a single publisher, the only one there is. An assumption: a
publisher keeps one message for late subscribers (depth 1), as those of /tf_static, /robot_description and
maps do; Fast DDS does not announce the depth. Where the middleware numbers no messages, those of several
publishers stay until there are MAX_MESSAGES.
"""

from collections.abc import Sequence
from typing import Final

from recorder.values import Channel, Sample

_LOG: Final = "/rosout"
"""Its publishers keep their newest 1000 lines: a history, and not what holds now."""
MAX_MESSAGES: Final = 64
"""Of a channel; then the oldest goes."""
MAX_BYTES: Final = 64 * 1024 * 1024
"""Of all channels; then the oldest of the largest channel goes, but no channel's newest message."""


class LatchedCache:
    """Keeps the newest message of each publisher, bounded. For one thread."""

    def __init__(self) -> None:
        self._channels: dict[Channel, list[Sample]] = {}
        self._bytes = 0

    def take(self, sample: Sample) -> None:
        """Takes a message of a latched channel."""
        if sample.channel.topic == _LOG:
            return
        kept = self._channels.setdefault(sample.channel, [])
        replaced = _replaced_by(sample, kept)
        if replaced is not None:
            self._remove(kept, replaced)
        elif len(kept) >= MAX_MESSAGES:
            self._remove(kept, 0)
        kept.append(sample)
        self._bytes += len(sample.data)
        while self._bytes > MAX_BYTES and (
            many := [each for each in self._channels.values() if len(each) > 1]
        ):
            self._remove(max(many, key=lambda each: sum(len(one.data) for one in each)), 0)

    def forget(self, channel: Channel) -> None:
        """Forgets the messages of a channel whose publishers are gone, or which is no longer taken."""
        for each in self._channels.pop(channel, []):
            self._bytes -= len(each.data)

    def samples(self) -> Sequence[Sample]:
        """Returns what is kept; of each channel in the order of reception."""
        return [sample for kept in self._channels.values() for sample in kept]

    def _remove(self, kept: list[Sample], at: int) -> None:
        self._bytes -= len(kept.pop(at).data)


def _replaced_by(sample: Sample, kept: Sequence[Sample]) -> int | None:
    """Returns the index of the message that this one makes obsolete; None if it may be another's."""
    for at, each in enumerate(kept):
        if each.data == sample.data:
            return at
    if not sample.publishers or len(kept) < sample.publishers:
        return None
    alone = sample.publishers == len(kept) == 1
    if alone and (not sample.sequence or kept[0].sequence < sample.sequence):
        return 0
    if not sample.sequence:
        return None
    preceding = [at for at, each in enumerate(kept) if each.sequence == sample.sequence - 1]
    return preceding[0] if len(preceding) == 1 else None
