"""How many commands a lane holds that the robot has not acknowledged."""

from console.client.driving import MAX_UNACKNOWLEDGED, OnTheirWay


def test_a_lane_is_full_until_what_was_written_on_it_is_acknowledged() -> None:
    """Commands that were made meanwhile and not written are not on their way: none is ever acknowledged."""
    lane = OnTheirWay()
    for sequence in range(1, MAX_UNACKNOWLEDGED + 1):
        assert not lane.full
        lane.add(sequence)
    assert lane.full
    lane.acknowledge(0)
    assert lane.full
    lane.acknowledge(1)
    assert not lane.full
    lane.add(500)
    assert lane.full
    lane.acknowledge(MAX_UNACKNOWLEDGED)
    lane.acknowledge(499)
    assert not lane.full
