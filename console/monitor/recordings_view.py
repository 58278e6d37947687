"""What a window shows of the recordings: the list, what operators have requested, and the exports."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from console.client import Recording
from console.monitor.export_meter import ExportRate


class Change(Enum):
    """What operators may request."""

    START = "start"
    STOP = "stop"
    KEEP = "keep"
    PIN = "pin"
    DELETE = "delete"


@dataclass(frozen=True, slots=True)
class ChangeRequest:
    """A request for a change of a recording; its ID is empty for the one that runs."""

    change: Change
    recording_id: str = ""


class ExportState(Enum):
    """State of an export."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportView:
    """An export at one moment.

    Args:
        folder: on this computer.
        state: its state.
        done, total: bytes; `total` is 0 before the first.
        rate: of the newest seconds.
        text: why nothing comes, what is there, or why it failed; may be empty.
    """

    folder: Path
    state: ExportState = ExportState.RUNNING
    done: int = 0
    total: int = 0
    rate: ExportRate = field(default_factory=ExportRate)
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingsView:
    """What is known of the recordings at one moment.

    Args:
        listed: the newest ones, the newest first; None before the first list.
        more: whether there are others.
        problem: why the list can't be had; empty while it can.
        pending: what the robot has yet to answer.
        denied: why this caller may change nothing; empty as long as nothing was refused for that.
        exports: by the recording's ID, the newest last.
        pictures: pixels by the recording's ID; empty ones where there are none.
    """

    listed: tuple[Recording, ...] | None = None
    more: bool = False
    problem: str = ""
    pending: frozenset[ChangeRequest] = frozenset()
    denied: str = ""
    exports: Mapping[str, ExportView] = field(default_factory=dict)
    pictures: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def exporting(self) -> str:
        """The ID of the recording that is being exported; empty without one."""
        running = (name for name, each in self.exports.items() if each.state is ExportState.RUNNING)
        return next(running, "")
