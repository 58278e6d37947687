from gateway.status.board import Board
from gateway.status.sources import DIAGNOSTICS, MUX_INPUTS, ODOMETRY
from gateway.status.values import (
    CommandSource,
    DiagnosticItem,
    DiagnosticLevel,
    Diagnostics,
    Received,
    Velocity,
)

KEYBOARD, AUTONOMY = MUX_INPUTS[CommandSource.KEYBOARD], MUX_INPUTS[CommandSource.AUTONOMY]


def test_a_value_is_kept_as_it_is() -> None:
    board, received = Board(), Received(Velocity(1, 2, 3), 5.0)
    assert board[ODOMETRY] is None
    board[ODOMETRY] = received
    assert board[ODOMETRY] is received


def test_each_input_of_the_mux_has_a_place_of_its_own() -> None:
    board = Board()
    board[KEYBOARD] = first = Received(Velocity(1, 0, 0), 5.0)
    board[AUTONOMY] = second = Received(Velocity(2, 0, 0), 6.0)
    assert (board[KEYBOARD], board[AUTONOMY]) == (first, second)
    assert board[MUX_INPUTS[CommandSource.NAVIGATION]] is None


def test_diagnostics_are_put_together_and_as_old_as_the_newest_message() -> None:
    board = Board()
    for number, name in enumerate(("drive", "arm")):
        item = DiagnosticItem(name, DiagnosticLevel.OK, "")
        board[DIAGNOSTICS] = Received(Diagnostics((item,)), float(number))
    newest = board[DIAGNOSTICS]
    assert newest
    assert [item.component for item in newest.value.items] == ["drive", "arm"]
    assert newest.at_s == 1.0
