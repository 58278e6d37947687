"""How a value gets onto the board: the one crossing between the threads, each time a reference assignment."""

from typing import Any

from gateway.config import SourceSettings
from gateway.status.board import Board, SourceKind
from gateway.status.diagnostics import merged
from gateway.status.values import Received


def place(board: Board, source: SourceSettings, received: Received[Any]) -> None:
    """Puts what a source gave into its slot."""
    if source.kind is SourceKind.DIAGNOSTICS and board.diagnostics:
        received = Received(merged(board.diagnostics.value, received.value), received.at_s)
    if source.label:
        board.mux_inputs = {**board.mux_inputs, source.label: received}
    else:
        setattr(board, source.kind.value, received)
