"""What `robotctl fleet` proposes where the hub does not do what was asked for."""

from console.cli.fleet_session import _REMEDIES, _UNREACHABLE
from fleet.errors import HubReason


def test_remedies_are_for_reasons_that_there_are() -> None:
    """They are named by their values, because the library of the hub may not be installed."""
    values = {each.value for each in HubReason}
    assert set(_REMEDIES) | set(_UNREACHABLE) <= values
    # Neither can be mended by the caller.
    assert values - set(_REMEDIES) == {HubReason.TOO_LARGE.value, HubReason.INVALID.value}
