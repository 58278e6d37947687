"""How many commands a lane holds that the robot has not acknowledged."""

from console.client.drive_lanes import MAX_UNACKNOWLEDGED, MAX_UNANSWERED, OnTheirWay


def test_a_lane_is_full_until_what_was_written_on_it_is_acknowledged() -> None:
    """Commands that were made meanwhile and not written are not on their way: none is ever acknowledged."""
    lane = OnTheirWay()
    full = []
    for sequence in range(1, MAX_UNACKNOWLEDGED + 1):
        full.append(lane.full)
        lane.add(sequence)
    assert not any(full)
    full = [lane.full]
    for newest, written in ((0, None), (1, None), (1, 500), (MAX_UNACKNOWLEDGED, None), (500, None)):
        lane.acknowledge(newest)
        if written:
            lane.add(written)
        full.append(lane.full)
    assert full == [True, True, False, True, False, False]


def test_a_lane_that_stands_still_is_full_although_the_other_one_acknowledges() -> None:
    lane = OnTheirWay()
    for sequence in range(1, MAX_UNANSWERED + 1):
        assert not lane.full
        lane.add(sequence)
        lane.acknowledge(sequence)
    assert lane.full
    lane.answered()
    assert not lane.full
