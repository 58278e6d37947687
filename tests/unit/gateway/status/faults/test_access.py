"""What the operators are told of the door: certificates near their end, files that can't be read."""

import pytest

from gateway.status.access import UNGUARDED, AccessView, CertificateExpiry
from gateway.status.fault import Severity
from gateway.status.faults.access import access_faults

DAY_S = 86_400.0


def ending(left_s: float) -> AccessView:
    return AccessView(
        (CertificateExpiry("server_certificate", "the certificate", "2027-03-01", left_s, "rotate"),)
    )


@pytest.mark.parametrize(
    ("left_s", "severities"),
    [
        (14 * DAY_S + 1, []),
        (14 * DAY_S, [Severity.WARNING]),
        (1, [Severity.WARNING]),
        (0, [Severity.ERROR]),
        (-DAY_S, [Severity.ERROR]),
    ],
)
def test_a_certificate_is_a_fault_before_it_ends_and_a_worse_one_after(
    left_s: float, severities: list[Severity]
) -> None:
    found = list(access_faults(ending(left_s), 14))
    assert [each.severity for each in found] == severities
    assert all(
        each.fault_id == "access.server_certificate" and "2027-03-01" in each.message for each in found
    )


def test_what_is_not_in_force_and_not_recorded_are_faults() -> None:
    found = {each.fault_id: each for each in access_faults(AccessView((), "it is damaged", "disk full"), 14)}
    assert found.keys() == {"access.credentials", "access.audit"}
    assert "it is damaged" in found["access.credentials"].message
    assert "disk full" in found["access.audit"].message


def test_a_door_that_is_well_or_unguarded_is_no_fault() -> None:
    assert list(access_faults(UNGUARDED, 14)) == []
