"""Snapshots of the gateway's status, for tests of the pure core."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from gateway.status.board import Board
from gateway.status.preview import Counters, PreviewState, PreviewView
from gateway.status.snapshot import Identity, Noted, Programs, Rules, Setup, Snapshot, SourceRule, take
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
    """Returns a snapshot of these sources; `more` replaces fields of its groups."""

    def fields_of(group: type[Any]) -> dict[str, Any]:
        return {each.name: more.pop(each.name) for each in fields(group) if each.name in more}

    usual: dict[str, Any] = {
        "identity": Identity("t", "0", insecure=False),
        "rules": Rules(sources or {}, 3000),
    }
    setup = Setup(**(usual | fields_of(Setup)))
    programs = Programs(**({"preview": OFF} | fields_of(Programs)))
    noted = Noted(**fields_of(Noted))
    assert not more, f"no fields of a snapshot: {more}"
    return take(setup, board or Board(), programs, now_s, noted)
