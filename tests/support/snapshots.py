"""Snapshots as a client gives them, and states made of them."""

from collections.abc import Callable

from console.client import OverlaySnapshot
from console.client.mapping.methods import GET_OVERLAY_SNAPSHOT
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState, PreviewRequest
from omniseer.gateway.v1 import overlay_pb2
from tests.support.gateway_double import healthy_status

NOW_S = 1000.0


def message() -> overlay_pb2.OverlaySnapshot:
    """A healthy robot on the wire, to be changed and given to `snapshot_of`."""
    return overlay_pb2.OverlaySnapshot(status=healthy_status())


def snapshot_of(made: overlay_pb2.OverlaySnapshot) -> OverlaySnapshot:
    """As a client decodes it."""
    return GET_OVERLAY_SNAPSHOT.decode(made.SerializeToString())


def snapshot(change: Callable[[overlay_pb2.OverlaySnapshot], object] = lambda _: None) -> OverlaySnapshot:
    """A healthy robot but for a change."""
    made = message()
    change(made)
    return snapshot_of(made)


def heard(
    taken: OverlaySnapshot | None = None, *, received_s: float = NOW_S, request: PreviewRequest | None = None
) -> MonitorState:
    """A robot that answers."""
    link = Link(state=LinkState.CONNECTED, since_s=received_s - 60, answer_ms=3)
    return MonitorState(link, taken or snapshot(), received_s, request)


def event(sequence: int, text: str = "", age_ms: int = 0) -> overlay_pb2.OperatorEvent:
    """An event on the wire."""
    return overlay_pb2.OperatorEvent(sequence=sequence, age_ms=age_ms, message=text or f"event {sequence}")
