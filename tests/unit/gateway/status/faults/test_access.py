"""What operators see of access: certificates near their end, files that can't be read."""

import pytest

from gateway.status.access import UNGUARDED, AccessView, CertificateExpiry, UnreadFile
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


@pytest.mark.parametrize(
    ("is_list", "what", "meanwhile"),
    [
        (True, "changed credentials are not in effect", "every caller is refused"),
        (False, "a changed certificate is not in effect", "changes of credentials take effect"),
    ],
)
def test_what_is_not_in_effect_is_a_fault_with_what_to_type(is_list: bool, what: str, meanwhile: str) -> None:
    unread = UnreadFile("it is damaged", "Type: chmod 600 it", is_list)
    [found] = access_faults(AccessView((), unread), 14)
    assert (found.fault_id, found.severity) == ("access.credentials", Severity.ERROR)
    assert found.message.startswith(f"{what}: it is damaged")
    assert meanwhile in found.message
    assert found.remedy == "On the robot, type: chmod 600 it"


def test_without_a_known_remedy_the_file_is_to_be_repaired() -> None:
    [found] = access_faults(AccessView((), UnreadFile("it is larger than 1 MiB", "", is_list=True)), 14)
    assert found.remedy == "Repair the file on the robot"


def test_what_is_not_recorded_is_a_fault() -> None:
    [found] = access_faults(AccessView(audit_error="disk full"), 14)
    assert found.fault_id == "access.audit"
    assert "disk full" in found.message


def test_a_door_that_is_well_or_unguarded_is_no_fault() -> None:
    assert list(access_faults(UNGUARDED, 14)) == []
