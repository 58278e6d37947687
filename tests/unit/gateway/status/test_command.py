"""Who gave the command: named only where there is no doubt."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.status.command import TOGETHER_S, TOLERANCE, effective_command
from gateway.status.values import CommandSource, Received, Velocity

NOW_S = 100.0
LIMIT_MS = 500
KEYBOARD, AUTONOMY, NAVIGATION = CommandSource
FORWARD, BACKWARD, STOP = Velocity(0.5, 0.0, 0.1), Velocity(-0.5, 0.0, 0.0), Velocity(0.0, 0.0, 0.0)


def giver(
    emitted: Velocity, inputs: dict[CommandSource, Received[Velocity]], at_s: float = NOW_S
) -> CommandSource | None:
    command = effective_command(Received(emitted, at_s), inputs, LIMIT_MS, NOW_S).value
    assert command is not None
    assert command.velocity == emitted
    return command.source


def test_no_command_was_ever_seen() -> None:
    seen = effective_command(None, {KEYBOARD: Received(FORWARD, NOW_S)}, LIMIT_MS, NOW_S)
    assert (seen.value, seen.freshness.available) == (None, False)


def test_the_input_that_spoke_last_and_asked_for_the_same_gave_it() -> None:
    inputs = {KEYBOARD: Received(FORWARD, NOW_S - 0.1), NAVIGATION: Received(BACKWARD, NOW_S - 0.2)}
    assert giver(FORWARD, inputs) is KEYBOARD


def test_one_that_spoke_earlier_is_not_guessed_at() -> None:
    """The mux may well follow the keyboard by priority; but who spoke last asked for something else."""
    inputs = {KEYBOARD: Received(FORWARD, NOW_S - 0.2), NAVIGATION: Received(BACKWARD, NOW_S - 0.1)}
    assert giver(FORWARD, inputs) is None


def test_what_no_input_asked_for_is_attributed_to_none() -> None:
    assert giver(STOP, {KEYBOARD: Received(FORWARD, NOW_S)}) is None
    assert giver(STOP, {}) is None


def test_an_input_of_long_ago_is_not_what_the_mux_emits_now() -> None:
    assert giver(STOP, {KEYBOARD: Received(STOP, NOW_S - TOGETHER_S - 0.01)}) is None
    assert giver(STOP, {KEYBOARD: Received(STOP, NOW_S - TOGETHER_S)}) is KEYBOARD


@pytest.mark.parametrize("part", ["vx_mps", "vy_mps", "wz_rad_s"])
def test_every_part_of_the_velocity_has_to_agree(part: str) -> None:
    speed = getattr(FORWARD, part)
    for off, expected in ((TOLERANCE / 2, KEYBOARD), (2 * TOLERANCE, None), (-2 * TOLERANCE, None)):
        asked = replace(FORWARD, **{part: speed + off})
        assert giver(FORWARD, {KEYBOARD: Received(asked, NOW_S)}) is expected, off


def test_a_mux_that_fell_silent_follows_no_input() -> None:
    at_s = NOW_S - LIMIT_MS / 1000 - 0.01
    seen = effective_command(Received(STOP, at_s), {AUTONOMY: Received(STOP, at_s)}, LIMIT_MS, NOW_S)
    assert seen.freshness.stale
    assert seen.value is not None
    assert seen.value.source is None


SPEEDS = st.floats(-2, 2)
VELOCITIES = st.builds(Velocity, SPEEDS, SPEEDS, SPEEDS)
INPUTS = st.dictionaries(
    st.sampled_from(CommandSource), st.builds(Received, VELOCITIES, st.floats(NOW_S - 1, NOW_S))
)


@given(emitted=st.builds(Received, VELOCITIES, st.floats(NOW_S - 1, NOW_S)), inputs=INPUTS)
def test_the_source_that_is_named_spoke_last_lately_and_asked_for_it(
    emitted: Received[Velocity], inputs: dict[CommandSource, Received[Velocity]]
) -> None:
    seen = effective_command(emitted, inputs, LIMIT_MS, NOW_S)
    assert seen.value is not None
    source = seen.value.source
    if source is None:
        return
    asked = inputs[source]
    assert not seen.freshness.stale
    assert asked.at_s == max(each.at_s for each in inputs.values())
    assert abs(asked.at_s - emitted.at_s) <= TOGETHER_S
    assert abs(asked.value.vx_mps - emitted.value.vx_mps) <= TOLERANCE


@given(
    emitted=VELOCITIES,
    age_s=st.floats(0, 0.4),
    apart_s=st.floats(-TOGETHER_S * 0.99, TOGETHER_S * 0.99),
    others=INPUTS,
    source=st.sampled_from(CommandSource),
)
def test_a_mux_that_passes_the_newest_input_on_is_always_attributed(
    emitted: Velocity,
    age_s: float,
    apart_s: float,
    others: dict[CommandSource, Received[Velocity]],
    source: CommandSource,
) -> None:
    at_s = NOW_S - age_s
    older = {
        giver: Received(received.value, min(received.at_s, at_s + apart_s) - 0.001)
        for giver, received in others.items()
    }
    inputs = older | {source: Received(emitted, at_s + apart_s)}
    assert giver(emitted, inputs, at_s) is source
