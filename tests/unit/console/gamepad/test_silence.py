"""How long a gamepad holds that reports nothing new."""

from dataclasses import replace

from console.gamepad.hands import PadInput
from console.gamepad.silence import HELD_FOR_S, Silence

STILL = PadInput(shoulder=True, wireless=True, values=(1, 2, 3))


def test_without_a_cable_it_holds_for_a_while_after_each_change() -> None:
    silence, now_s = Silence(), 100.0
    assert not silence.take(STILL, now_s), "it is new"
    for number in range(5):
        moved = replace(STILL, values=(1, 2, number))
        assert not silence.take(moved, now_s)
        assert not silence.take(moved, now_s + HELD_FOR_S)
        now_s += HELD_FOR_S + 0.01
        assert silence.take(moved, now_s)
        assert silence.take(moved, now_s + 60.0)


def test_with_a_cable_it_may_be_held_still() -> None:
    silence, still = Silence(), replace(STILL, wireless=False)
    assert not silence.take(still, 100.0)
    assert not silence.take(still, 1000.0)


def test_another_gamepad_begins_anew() -> None:
    silence = Silence()
    silence.take(STILL, 100.0)
    assert not silence.take(None, 200.0)
    assert not silence.take(STILL, 300.0)
    assert not silence.take(STILL, 300.0 + HELD_FOR_S)
