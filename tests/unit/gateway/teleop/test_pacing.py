"""At most 60 commands a second are passed on, the newest of those there are, and every release."""

from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from gateway.teleop.pacing import PASSED_PER_S, Pacing


@dataclass(frozen=True)
class Command:
    number: int
    held: bool


@given(
    st.lists(st.tuples(st.floats(0, 0.05), st.booleans()), min_size=1, max_size=200),
)
def test_no_release_is_dropped_and_the_newest_comes_last(commands: list[tuple[float, bool]]) -> None:
    pacing, now_s, passed, held = Pacing[Command](0.0), 0.0, list[Command](), False
    releases = 0
    for number, (gap_s, holds) in enumerate(commands):
        now_s += gap_s
        if due := pacing.due(now_s):
            passed.append(due)
        last = passed[-1].held if passed else False
        command = Command(number, holds)
        taken = pacing.take(command, now_s)
        if taken:
            assert taken is command
            passed.append(taken)
        if last and not holds:
            releases += 1
            assert taken is command, "a release passes at once"
        held = holds
    due_in_s = pacing.due_in_s
    if due_in_s is not None and (due := pacing.due(now_s + due_in_s + 1e-9)):
        passed.append(due)
    assert passed[-1].number == len(commands) - 1, "the newest gets through"
    assert passed[-1].held == held
    assert [each.number for each in passed] == sorted({each.number for each in passed})
    # Three at once, then 60 a second, and releases besides.
    assert len(passed) <= 3 + PASSED_PER_S * (now_s + 1 / PASSED_PER_S) + releases + 1


def test_fifty_commands_a_second_all_pass() -> None:
    pacing = Pacing[Command](0.0)
    passed = [pacing.take(Command(number, True), number / 50) for number in range(100)]
    assert None not in passed


def test_a_flood_is_coalesced_to_the_newest() -> None:
    pacing = Pacing[Command](0.0)
    passed = [pacing.take(Command(number, True), number / 200) for number in range(400)]
    assert len([each for each in passed if each]) <= 2 * PASSED_PER_S + 3
    assert pacing.due_in_s is not None
    assert pacing.due(2.1) == Command(399, True)
