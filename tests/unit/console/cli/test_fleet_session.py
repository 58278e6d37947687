"""How long `robotctl fleet` waits for the hub, and what it proposes where that does not do as requested."""

from console.cli.fleet_session import _REMEDIES, _UNREACHABLE, ANSWERS_WITHIN_S
from fleet.errors import HubReason
from fleet.opening import NEXT_AFTER_S, REFUSED_AFTER_S


def test_remedies_are_for_reasons_that_there_are() -> None:
    """They are named by their values, because the library of the hub may not be installed."""
    values = {each.value for each in HubReason}
    assert set(_REMEDIES) | set(_UNREACHABLE) <= values
    # Neither can be mended by the caller.
    assert values - set(_REMEDIES) == {HubReason.TOO_LARGE.value, HubReason.INVALID.value}


def test_two_silent_servers_of_three_leave_time_for_the_third() -> None:
    assert 2 * NEXT_AFTER_S < ANSWERS_WITHIN_S / 2


def test_and_a_refusal_is_known_before_it_ends() -> None:
    assert 2 * NEXT_AFTER_S + REFUSED_AFTER_S < ANSWERS_WITHIN_S
