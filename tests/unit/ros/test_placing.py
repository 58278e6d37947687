from gateway.config import DEFAULT_SOURCES
from gateway.ros.placing import place
from gateway.status.board import Board
from gateway.status.values import (
    CommandSource,
    DiagnosticItem,
    DiagnosticLevel,
    Diagnostics,
    Odometry,
    Received,
    Velocity,
)

SOURCES = {source.name: source for source in DEFAULT_SOURCES}


def test_a_value_goes_to_the_slot_of_its_kind() -> None:
    board, received = Board(), Received(Odometry(1, 2, 3), 5.0)
    place(board, SOURCES["odometry"], received)
    assert board.odometry is received


def test_each_input_of_the_mux_has_a_place_of_its_own() -> None:
    board = Board()
    place(board, SOURCES["mux_input.keyboard"], Received(Velocity(1, 0, 0), 5.0))
    before = board.mux_inputs
    place(board, SOURCES["mux_input.autonomy"], Received(Velocity(2, 0, 0), 6.0))
    assert set(board.mux_inputs) == {CommandSource.KEYBOARD, CommandSource.AUTONOMY}
    assert set(before) == {CommandSource.KEYBOARD}, "whoever looks at it just now sees no change"


def test_diagnostics_are_put_together_and_as_old_as_the_newest_message() -> None:
    board = Board()
    for number, name in enumerate(("drive", "arm")):
        item = DiagnosticItem(name, DiagnosticLevel.OK, "")
        place(board, SOURCES["diagnostics"], Received(Diagnostics((item,)), float(number)))
    assert board.diagnostics
    assert [item.component for item in board.diagnostics.value.items] == ["drive", "arm"]
    assert board.diagnostics.at_s == 1.0
