"""Faults of what guards the gateway: certificates near their end, credentials that can't be read."""

from collections.abc import Iterator
from typing import Final

from gateway.status.access import AccessView
from gateway.status.faults.fault import Condition, Severity

_COMPONENT: Final = "access"
_DAY_S: Final = 86_400


def access_faults(access: AccessView, warn_days: float) -> Iterator[Condition]:
    """What is wrong now.

    Args:
        access: this instant.
        warn_days: how long before its end a certificate is a fault.
    """
    for certificate in access.certificates:
        if certificate.left_s <= 0:
            yield Condition(
                f"access.{certificate.key}",
                Severity.ERROR,
                _COMPONENT,
                f"{certificate.words} ended on {certificate.ends_on}",
                certificate.remedy,
            )
        elif certificate.left_s <= warn_days * _DAY_S:
            yield Condition(
                f"access.{certificate.key}",
                Severity.WARNING,
                _COMPONENT,
                f"{certificate.words} ends on {certificate.ends_on}",
                certificate.remedy,
            )
    if access.trouble:
        yield Condition(
            "access.credentials",
            Severity.ERROR,
            _COMPONENT,
            f"changed credentials are not in force: {access.trouble}",
            "Mend the file on the robot; until then those that were read last count",
        )
    if access.audit_trouble:
        yield Condition(
            "access.audit",
            Severity.WARNING,
            _COMPONENT,
            f"the audit log is not written: {access.audit_trouble}",
            "Make room on the robot's disk, or look at the rights of the file",
        )
