"""What the operator's side needs of the rest of the gateway."""

from typing import Protocol

from gateway.status.event import ControlAction, Event
from gateway.status.pictures import PictureReport, Pictures
from gateway.status.preview import PreviewView
from gateway.status.snapshot import Snapshot


class SnapshotSource(Protocol):
    """Where responses get their content from."""

    def snapshot(self) -> Snapshot:
        """Returns everything at this instant."""


class StatusSource(SnapshotSource, Protocol):
    """The same, with what shows that a snapshot is outdated before its time."""

    @property
    def preview(self) -> PreviewView:
        """The preview at this instant; a new object whenever it changed."""

    @property
    def ros_passed_s(self) -> float | None:
        """When the newest pass of the ROS sampler ended, as `Board.ros_passed_s`."""


class PictureSink(SnapshotSource, Protocol):
    """The same, where viewers' reports go as well."""

    def take_picture(self, caller: str, viewer_id: str, report: PictureReport) -> Pictures:
        """Takes a report of this instant; returns what all say that count now."""


class EventSink(Protocol):
    """Where events go."""

    def note(self, event: Event) -> None:
        """Takes an event of this instant."""


class AuditSink(Protocol):
    """Where control actions are kept; events are forgotten after a while."""

    def record(self, action: ControlAction) -> None:
        """Takes one action. Never waits."""


class CredentialFiles(Protocol):
    """Where credentials come from."""

    async def reload_for_unknown(self) -> None:
        """Reads them again: a caller showed one that is not among them."""


class StreamKey(Protocol):
    """The secret that callers share: the passphrase of the video stream."""

    def renew_passphrase(self) -> None:
        """Replaces it, which disconnects all viewers."""
