"""What waits to be written: samples of channels, losses, and notes.

Times in nanoseconds count from 1970-01-01 UTC by the calendar clock, unless a name says monotonic.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
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
