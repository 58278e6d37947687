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


class PipelineEvents(Protocol):
    """Receives the events of a pipeline, on the event loop; none comes after a fault or after `stop`."""

    def first_frame(self) -> None:
        """The first encoded frame has reached the listener. Once per pipeline."""

    def failed(self, fault: Fault) -> None:
        """The pipeline has failed. Once per pipeline: only the first fault is reported."""

    def measured(self, viewers_refused: int) -> None:
        """New statistics are available; so many viewers were refused since the last ones."""
