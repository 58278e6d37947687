"""Snapshots of the gateway's status, for tests of the pure core."""

from collections.abc import Mapping
from typing import Any

from gateway.status.board import Board
from gateway.status.preview import Counters, PreviewState, PreviewView
from gateway.status.snapshot import Identity, Rules, Snapshot, SourceRule, take
from gateway.status.sources import SourceSpec

OFF = PreviewView(PreviewState.DISABLED, None, "", True, None, None, None, None, Counters())
"""A reachable preview service, the preview is off."""


def snapshot_of(
    board: Board | None = None,
    sources: Mapping[SourceSpec[Any], SourceRule] | None = None,
    *,
    now_s: float,
    **more: Any,
) -> Snapshot:
    """Returns a snapshot of these sources; `more` replaces arguments of `take`."""
    arguments: dict[str, Any] = {
        "identity": Identity("t", "0", insecure=False),
        "rules": Rules(sources or {}, 3000),
        "board": board or Board(),
        "preview": OFF,
        "events": (),
        "now_s": now_s,
    }
    return take(**(arguments | more))
