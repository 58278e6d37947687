"""Addresses that one sender can choose among count as one."""

import pytest

from gateway.access.address_prefix import address_prefix


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.0.0.5", "::ffff:10.0.0.5", True),
        ("2001:db8::1", "2001:db8::ffff:2", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2%eth1", True),
        ("10.0.0.5", "10.0.0.6", False),
        ("local socket", "local socket", True),
    ],
)
def test_another_address_of_the_same_sender_has_the_same_prefix(one: str, other: str, same: bool) -> None:
    assert (address_prefix(one) == address_prefix(other)) is same
