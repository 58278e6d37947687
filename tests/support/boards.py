"""What tests ask of a gateway's board."""

from typing import Any

from gateway.status.board import Board
from gateway.status.sources import SourceSpec, ValueT
from gateway.status.values import Received


def newest(board: Board, spec: SourceSpec[ValueT]) -> Received[ValueT]:
    """Returns the newest value of a source; fails the test if there is none."""
    received = board[spec]
    assert received, f"no {spec.kind} was received"
    return received


def has_all(board: Board, *specs: SourceSpec[Any]) -> bool:
    """Returns whether each of these sources has a value."""
    return all(board[spec] for spec in specs)
