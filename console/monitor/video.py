"""What the picture needs to know, out of the monitor's state."""

from typing import Protocol

from console.client import GatewayError
from console.client.results import PreviewStatus
from console.monitor.link import Phase
from console.monitor.state import MonitorState
from console.viewer.overlay import Overlay


class Stream(Protocol):
    """Who receives the video; `console.viewer.session.VideoSession` does."""

    def follow(self, preview: PreviewStatus) -> None:
        """The gateway's newest word."""

    def lost(self, trouble: GatewayError) -> None:
        """The gateway does not answer."""


def pass_on(state: MonitorState, stream: Stream) -> None:
    """Tells the stream what is new; in whatever thread there is news."""
    if state.link.phase is Phase.CONNECTED and state.snapshot:
        stream.follow(state.snapshot.status.preview)
    elif state.link.trouble:
        stream.lost(state.link.trouble)


def overlay_of(state: MonitorState) -> Overlay | None:
    """The newest detections."""
    return Overlay(state.snapshot.detections, state.received_s) if state.snapshot else None
