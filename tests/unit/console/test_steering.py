"""From keys and sticks to velocities."""

from console.steering import LETTERS, Direction, Speeds, Steering, steering_of


def test_keys_add_up_and_opposite_ones_cancel_out() -> None:
    assert steering_of([]) is None
    assert steering_of([Direction.FORWARD, Direction.TURN_LEFT]) == (1, 0, 1)
    assert steering_of([Direction.FORWARD, Direction.BACK]) == (0, 0, 0), "held, without a velocity"
    assert steering_of(list(Direction)) == (0, 0, 0)


def test_two_keys_of_one_direction_are_one() -> None:
    assert steering_of([Direction.FORWARD, Direction.FORWARD, Direction.TURN_LEFT]) == (1, 0, 1)


def test_each_direction_has_a_letter_of_its_own() -> None:
    assert sorted(LETTERS.values(), key=lambda each: each.name) == sorted(
        Direction, key=lambda each: each.name
    )


def test_a_velocity_is_the_share_of_each() -> None:
    assert Speeds(0.5, 0.25, 2.0).velocity(Steering(0.5, -1.0, 0.25)) == (0.25, -0.25, 0.5)
