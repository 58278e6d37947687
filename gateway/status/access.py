"""The state of authentication and encryption, as far as operators should know it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CertificateExpiry:
    """A certificate and its end of validity.

    Attributes:
        key: short and stable; "server_certificate" for example.
        name: the name for people.
        ends_on: last day of validity as "2027-03-01".
        left_s: seconds until then; negative after it.
        remedy: what to type.
    """

    key: str
    name: str
    ends_on: str
    left_s: float
    remedy: str


@dataclass(frozen=True, slots=True)
class UnreadFile:
    """A changed file that can't be read, so that what it contains is not in effect.

    Attributes:
        why: what is wrong with it.
        remedy: what to do or to type; empty if unknown.
        is_list: whether it is the list of credentials; otherwise a certificate or its key.
    """

    why: str
    remedy: str
    is_list: bool


@dataclass(frozen=True, slots=True)
class AccessView:
    """The state at one instant.

    Attributes:
        certificates: those that TLS depends on.
        unread: what of the files is not in effect; None if all is.
        audit_error: why the audit log can't be written; empty if it can.
        closed: whether no credential is accepted because the list could not be read for too long.
    """

    certificates: tuple[CertificateExpiry, ...] = ()
    unread: UnreadFile | None = None
    audit_error: str = ""
    closed: bool = False


UNGUARDED = AccessView()
