"""What a finished segment contains, and what it lacks.

Times in nanoseconds count from 1970-01-01 UTC by the calendar clock, unless a name says monotonic.
"""

from dataclasses import dataclass, replace
from pathlib import Path

from recorder.values.items import GapCause


@dataclass(frozen=True, slots=True)
class ChannelSummary:
    """One channel of a finished segment."""

    topic: str
    type: str
    offered_qos: str
    messages: int


@dataclass(frozen=True, slots=True)
class Gap:
    """A loss as a file keeps it: with the topic's name instead of the channel."""

    topic: str
    """Empty if of the video or of all channels."""
    cause: GapCause
    began_ns: int
    ended_ns: int
    messages: int | None


@dataclass(frozen=True, slots=True)
class Losses:
    """How much is missing.

    Attributes:
        messages: as far as they were counted.
        uncounted: gaps of which it is unknown how many messages they lost, those of the video aside.
        numbered: whether the middleware numbers the messages, so that they can be counted.
    """

    messages: int = 0
    uncounted: int = 0
    numbered: bool = True

    @property
    def counted(self) -> int | None:
        """Messages lost as far as they were counted; None where 0 would say that nothing is missing."""
        if not self.numbered or (self.uncounted and not self.messages):
            return None
        return self.messages

    def with_loss(self, cause: GapCause, messages: int | None) -> "Losses":
        """Returns the losses with one more; None: it is unknown how many messages."""
        if messages is not None:
            return replace(self, messages=self.messages + messages)
        return self if cause is GapCause.VIDEO else replace(self, uncounted=self.uncounted + 1)

    def __add__(self, other: "Losses") -> "Losses":
        return Losses(
            self.messages + other.messages,
            self.uncounted + other.uncounted,
            self.numbered and other.numbered,
        )


@dataclass(frozen=True, slots=True)
class SegmentSummary:
    """What a finished segment contains."""

    path: Path
    size: int
    """In bytes."""
    sha256: str
    """Of its content, 64 hexadecimal digits."""
    messages: int
    channels: tuple[ChannelSummary, ...]
    """In the order of their first messages."""
    first_ns: int | None
    """Earliest log time; None without messages."""
    last_ns: int | None
    """Latest log time."""
    gaps: tuple[Gap, ...]
    """In the order in which they were recorded."""
    numbered: bool = True
    """Whether all of its messages are numbered, those of the video aside."""
