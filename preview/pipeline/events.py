"""What a pipeline reports to its owner. Pure."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Blame(Enum):
    """Part that failed. Only a failure of the encoder makes the next encoder take over."""

    SOURCE = "source"
    ENCODER = "encoder"
    LISTENER = "listener"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Fault:
    """Failure of a pipeline.

    Args:
        blame: part that failed.
        text: what happened and what to do, for `last_error`.
    """

    blame: Blame
    text: str


class HungError(Exception):
    """A driver does not return: only the end of the process frees its device and port."""


@dataclass(frozen=True, slots=True, eq=False)
class AccessUnit:
    """One encoded frame.

    Args:
        data: as a byte stream; key frames come with their parameter sets.
        captured_ns: capture time on CLOCK_MONOTONIC.
        key_frame: whether it decodes without earlier ones.
        skipped: access units that are missing before it because the event loop did not take them in time.
    """

    data: bytes
    captured_ns: int
    key_frame: bool
    skipped: int = 0


class PipelineEvents(Protocol):
    """Receives the events of a pipeline, on the event loop; none comes after a fault or after `stop`."""

    def first_frame(self) -> None:
        """The first encoded frame has reached the listener. Once per pipeline."""

    def failed(self, fault: Fault) -> None:
        """The pipeline has failed. Once per pipeline: only the first fault is reported."""

    def listener_failed(self, fault: Fault) -> bool:
        """The listener has failed; whether the pipeline goes on without it. Otherwise it fails as a whole."""

    def camera_shown(self, camera: str) -> None:
        """Another camera is live."""

    def camera_failed(self, camera: str, fault: Fault) -> bool:
        """A camera has failed: the live one, or one that was to become it.

        Returns:
            Whether the pipeline goes on: with the live camera, or with another one that is being started.
            Otherwise it fails as a whole.
        """

    def measured(self, viewers_refused: int) -> None:
        """New statistics are available; so many viewers were refused since the last ones."""
