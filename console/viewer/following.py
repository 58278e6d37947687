"""From what the gateway says to what a viewer needs: which stream to follow, and what to draw over it."""

from console.monitor.link import Phase as LinkPhase
from console.monitor.state import MonitorState
from console.viewer.overlay import Overlay
from console.viewer.session import VideoSession


def follow(session: VideoSession, state: MonitorState) -> None:
    """Tells a session the newest of what is known of the robot. Only hands over; from any thread."""
    if state.link.phase is LinkPhase.LOST and state.link.trouble:
        session.lost(state.link.trouble)
    elif state.snapshot:
        session.follow(state.snapshot.status.preview)


def overlay_of(state: MonitorState) -> Overlay | None:
    """The newest detections."""
    return Overlay(state.snapshot.detections, state.received_s) if state.snapshot else None
