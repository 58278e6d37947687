"""Values that the recorder's packages share: channels, samples, losses, and what a finished segment contains.

Times in nanoseconds count from 1970-01-01 UTC by the calendar clock, unless a name says monotonic.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Final

VIDEO_TOPIC: Final = "/preview/video"
"""Topic of the preview's video in recordings. No node publishes it."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One topic with one message type. Compared by identity: a topic with another type is a new channel."""

    topic: str
    """ROS name: "/odom"."""
    type: str
    """ROS name: "nav_msgs/msg/Odometry"."""
    schema: bytes
    """Definition of the type and of those it contains; empty if unknown."""
    schema_encoding: str
    """As in the MCAP registry: "ros2msg"; empty if the definition is unknown."""
    offered_qos: str
    """What the publishers offer, as the YAML that rosbag2 keeps in "offered_qos_profiles"."""
    latched: bool
    """Whether the publishers are transient local: each segment begins with the newest messages."""
    presets: frozenset[str]
    """Names of the presets that record it."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One message, as received."""

    channel: Channel
    data: bytes
    """CDR with its encapsulation header of 4 bytes."""
    log_time_ns: int
    """When it was received."""
    publish_time_ns: int
    """When it was published, by the publisher's clock."""
    sequence: int
    """Its number among those of its publisher; 0 if the middleware does not number messages."""
    monotonic_ns: int
    """When it was received, by CLOCK_MONOTONIC."""
    publishers: int = 0
    """Of a latched channel: how many publishers its topic had when this message was there; 0 if unknown."""
    follows: bool = False
    """Whether it is useless without the one before it: a frame of the video at which no decoder can begin."""


class GapCause(Enum):
    """Why messages are missing."""

    MIDDLEWARE = "middleware"
    """They were lost before the recorder could take them."""
    QUEUE = "queue"
    """The recorder's own queue was full."""
    INTERRUPTED = "interrupted"
    """The recorder was not running, or the end of a file was damaged."""
    VIDEO = "video"
    """Frames could not be taken from the preview."""
    DISK = "disk"
    """The disk refused to write."""


@dataclass(frozen=True, slots=True)
class Loss:
    """Messages that are missing, in order with those that are not."""

    channel: Channel | None
    """Whose; None if of the video or of all channels."""
    cause: GapCause
    began_ns: int
    ended_ns: int
    """The same as the begin where only the number is known."""
    messages: int | None
    """How many; None if unknown."""


@dataclass(frozen=True, slots=True)
class Note:
    """A named set of texts that a file keeps beside its messages (an MCAP metadata record)."""

    name: str
    values: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Ended:
    """A topic is no longer taken: what its publishers had kept for late subscribers is no longer of now."""

    channel: Channel


Item = Sample | Loss | Note | Ended
"""What waits to be written."""


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
