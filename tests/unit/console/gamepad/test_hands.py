"""What a gamepad holds, and what it has to show first."""

from dataclasses import replace

import pytest

from console.gamepad.hands import PadHands, PadInput
from console.steering import Steering

REST = PadInput()
HELD = PadInput(shoulder=True)
FORWARD = PadInput(left_y=-1.0, shoulder=True)


def after(*inputs: PadInput | None) -> Steering | None:
    hands = PadHands()
    for each in inputs:
        hands.take(each)
    return hands.steering


@pytest.mark.parametrize(
    ("deflected", "steering"),
    [
        (HELD, (0, 0, 0)),
        (FORWARD, (1, 0, 0)),
        (replace(HELD, left_x=1.0), (0, -1, 0)),
        (replace(HELD, right_x=-1.0), (0, 0, 1)),
    ],
)
def test_the_shoulder_holds_and_the_sticks_steer(deflected: PadInput, steering: Steering) -> None:
    assert after(REST, deflected) == steering
    assert after(REST, replace(deflected, shoulder=False)) is None


def test_a_shoulder_that_was_never_up_holds_nothing() -> None:
    assert after(HELD) is None
    assert after(HELD, FORWARD) is None
    assert after(HELD, REST, FORWARD) == (1, 0, 0)


def test_a_stick_counts_only_after_it_was_neutral() -> None:
    lies_on = PadInput(left_y=-1.0, right_x=0.05)
    turning = replace(lies_on, shoulder=True, right_x=-1.0)
    assert after(lies_on, turning) == (0, 0, 1), "the other one does"
    assert after(lies_on, REST, turning) == (1, 0, 1)


@pytest.mark.parametrize("removed", [True, False], ids=["removed", "forgotten"])
def test_what_comes_back_begins_anew(removed: bool) -> None:
    hands = PadHands()
    for each in (REST, FORWARD):
        hands.take(each)
    if removed:
        hands.take(None)
    else:
        hands.forget()
    assert hands.steering is None
    hands.take(FORWARD)
    assert hands.steering is None
    hands.take(REST)
    hands.take(FORWARD)
    assert hands.steering == (1, 0, 0)


def test_stop_counts_once_and_not_when_it_was_down_from_the_beginning() -> None:
    hands, pressed = PadHands(), PadInput(stop=True)
    hands.take(pressed)
    assert not hands.take_stop()
    for each in (REST, pressed, pressed):
        hands.forget()
        hands.take(each)
    assert hands.take_stop()
    assert not hands.take_stop()
