"""Faults of authentication and encryption: certificates that expire, credentials that can't be read."""

from collections.abc import Iterator
from typing import Final

from gateway.status.access import AccessView, UnreadFile
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
    if access.unread:
        yield _not_in_effect(access.unread)
    if access.audit_error:
        yield Condition(
            "access.audit",
            Severity.WARNING,
            _COMPONENT,
            f"the audit log is not written: {access.audit_error}",
            "Free space on the robot's disk, or check the permissions of the file",
        )


def _not_in_effect(unread: UnreadFile) -> Condition:
    if unread.is_list:
        what = "changed credentials are not in effect"
        meanwhile = "those that were read last apply for a minute, then every caller is refused"
    else:
        what = "a changed certificate is not in effect"
        meanwhile = "the one that was read last is used; changes of credentials take effect all the same"
    # "On the robot, type: ..." where the remedy is "Type: ...".
    remedy = f"On the robot, {unread.remedy[:1].lower()}{unread.remedy[1:]}" if unread.remedy else ""
    return Condition(
        "access.credentials",
        Severity.ERROR,
        _COMPONENT,
        f"{what}: {unread.why}; {meanwhile}",
        remedy or "Repair the file on the robot",
    )
