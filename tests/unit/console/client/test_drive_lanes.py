"""How many commands a lane holds that the robot has not acknowledged."""

import pytest

from console.client.drive_lanes import MAX_UNACKNOWLEDGED, MAX_UNANSWERED, OnTheirWay
from gateway.teleop.lane import COMMANDS_PER_S


@pytest.mark.parametrize("held", [True, False])
def test_a_lane_is_full_until_what_was_written_on_it_is_acknowledged(held: bool) -> None:
    """Commands that were made meanwhile and not written are not on their way: none is ever acknowledged."""
    lane = OnTheirWay()
    room = []
    for sequence in range(1, MAX_UNACKNOWLEDGED + 1):
        room.append(lane.has_room(held=held))
        lane.add(sequence, held=held)
    assert all(room)
    room = [lane.has_room(held=held)]
    for newest, written in ((0, None), (1, None), (1, 500), (MAX_UNACKNOWLEDGED, None), (500, None)):
        lane.acknowledge(newest)
        if written:
            lane.add(written, held=held)
        room.append(lane.has_room(held=held))
    assert room == [False, False, True, False, True, True]


@pytest.mark.parametrize("held", [True, False])
def test_a_lane_that_stands_still_is_full_although_the_other_one_acknowledges(held: bool) -> None:
    lane = OnTheirWay()
    for sequence in range(1, MAX_UNANSWERED + 1):
        assert lane.has_room(held=held)
        lane.add(sequence, held=held)
        lane.acknowledge(sequence)
    assert not lane.has_room(held=held)
    lane.answered()
    assert lane.has_room(held=held)


def test_a_release_passes_a_full_lane_once_and_no_hold_follows_it() -> None:
    lane = OnTheirWay()
    for sequence in range(1, MAX_UNACKNOWLEDGED + 1):
        lane.add(sequence, held=True)
    assert lane.has_room(held=False)
    lane.add(500, held=False)
    assert not lane.has_room(held=False)
    assert not lane.has_room(held=True)
    lane.acknowledge(MAX_UNACKNOWLEDGED)
    assert lane.has_room(held=True)


def test_a_lane_that_stands_still_holds_fewer_commands_than_the_gateway_takes_at_once() -> None:
    """Whatever the driver's hands do meanwhile, and although another lane acknowledges."""
    lane = OnTheirWay()
    written = 0
    for sequence in range(1, 10 * MAX_UNANSWERED):
        held = sequence % 2 == 0
        if lane.has_room(held=held):
            lane.add(sequence, held=held)
            written += 1
        lane.acknowledge(sequence)
    assert MAX_UNANSWERED <= written <= MAX_UNANSWERED + 1
    assert written < COMMANDS_PER_S
