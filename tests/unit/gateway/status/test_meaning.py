"""Which numbers are good, and how a limit is left again."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.status.fault import Severity
from gateway.status.limit import Limit
from gateway.status.meaning import ANY_NUMBER, NumberMeaning, Side

MEANING = NumberMeaning(
    unit="V",
    error_below=Limit(10.0, 11.0),
    warning_below=Limit(12.0, 13.0),
    warning_above=Limit(20.0, 18.0),
    error_above=Limit(24.0, 22.0),
)
WARNING, ERROR = Severity.WARNING, Severity.ERROR


def walk(*values: float) -> list[str]:
    """The verdict on each value, given the one before."""
    before: dict[Side, Severity] = {}
    words = []
    for value in values:
        found = MEANING.violation(value, before)
        before = {found.side: found.severity} if found else {}
        words.append(f"{found.severity.value} {found.side.value}" if found else "good")
    return words


def test_each_limit_counts_from_its_own_value_on() -> None:
    assert walk(15.0, 20.0) == ["good", "warning high"]
    assert walk(19.9) == ["good"]
    assert walk(24.0) == ["error high"]
    assert walk(12.0) == ["warning low"]
    assert walk(10.0) == ["error low"]


def test_a_limit_is_left_only_beyond_its_clearing_value() -> None:
    assert walk(20.0, 19.0, 18.0) == ["warning high", "warning high", "good"]
    assert walk(24.0, 23.0, 22.0, 19.0, 17.9) == [
        "error high",
        "error high",
        "warning high",
        "warning high",
        "good",
    ]
    assert walk(9.0, 10.9, 11.0, 13.0) == ["error low", "error low", "warning low", "good"]


def test_a_jump_from_one_side_to_the_other_is_judged_at_once() -> None:
    assert walk(25.0, 9.0) == ["error high", "error low"]


def test_without_limits_every_number_is_good() -> None:
    assert ANY_NUMBER.violation(1e300, {}) is None
    assert ANY_NUMBER.violation(-1e300, {Side.LOW: ERROR}) is None


@given(st.floats(allow_nan=False), st.sampled_from([{}, {Side.HIGH: WARNING}, {Side.HIGH: ERROR}]))
def test_a_worse_past_never_makes_a_value_better(value: float, before: dict[Side, Severity]) -> None:
    now, fresh = MEANING.violation(value, before), MEANING.violation(value, {})
    assert (now.severity.rank if now else -1) >= (fresh.severity.rank if fresh else -1)
