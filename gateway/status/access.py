"""What guards the gateway, as far as the operators should know how it is doing."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CertificateEnd:
    """A certificate that ends some day.

    Attributes:
        key: short and stable, "server_certificate" for example.
        words: the same for people.
        ends_on: the day, as "2027-03-01".
        left_s: until then; negative when it is over.
        remedy: what to type.
    """

    key: str
    words: str
    ends_on: str
    left_s: float
    remedy: str


@dataclass(frozen=True, slots=True)
class AccessView:
    """At one instant.

    Attributes:
        certificates: that TLS depends on.
        trouble: why the newest credentials are not in force; empty when they are.
        audit_trouble: why the audit log is not written; empty when it is.
    """

    certificates: tuple[CertificateEnd, ...] = ()
    trouble: str = ""
    audit_trouble: str = ""


UNGUARDED = AccessView()
