"""Faults of authentication and encryption: certificates that expire, credentials that can't be read."""

from collections.abc import Iterator
from typing import Final

from gateway.status.access import AccessView
from gateway.status.fault import Condition, Severity

_COMPONENT: Final = "access"
_DAY_S: Final = 86_400


def access_faults(access: AccessView, warn_days: float) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        access: the state to examine.
        warn_days: how long before its end of validity a certificate is a fault.
    """
    for certificate in access.certificates:
        if certificate.left_s > warn_days * _DAY_S:
            continue
        expired = certificate.left_s <= 0
        yield Condition(
            f"access.{certificate.key}",
            Severity.ERROR if expired else Severity.WARNING,
            _COMPONENT,
            f"{certificate.name} {'expired' if expired else 'expires'} on {certificate.ends_on}",
            certificate.remedy,
        )
    if access.credentials_error:
        yield Condition(
            "access.credentials",
            Severity.ERROR,
            _COMPONENT,
            f"changed credentials are not in force: {access.credentials_error}",
            "Repair the file on the robot; until then the credentials that were read last apply, but "
            "an unreadable list of credentials only for a minute: then every caller is refused",
        )
    if access.audit_error:
        yield Condition(
            "access.audit",
            Severity.WARNING,
            _COMPONENT,
            f"the audit log is not written: {access.audit_error}",
            "Free space on the robot's disk, or check the permissions of the file",
        )
