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
class AccessView:
    """The state at one instant.

    Attributes:
        certificates: those that TLS depends on.
        credentials_error: why the newest credentials are not in force; empty if they are.
        closed: whether no credential is accepted because of that error, which has lasted too long.
        audit_error: why the audit log can't be written; empty if it can.
    """

    certificates: tuple[CertificateExpiry, ...] = ()
    credentials_error: str = ""
    audit_error: str = ""
    closed: bool = False


UNGUARDED = AccessView()
