"""A credential as the robot stores it, and the principal that it authenticates."""

from dataclasses import dataclass
from enum import Enum

from gateway.access.role import Role


class Kind(Enum):
    """Kind of a credential."""

    TOKEN = "token"  # noqa: S105  # a name
    CERTIFICATE = "certificate"


class Validity(Enum):
    """Validity of a credential at one instant."""

    VALID = "valid"
    NOT_YET = "not yet valid"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True, slots=True)
class Credential:
    """A credential without its secret. Instants are seconds since 1970 (UTC).

    Attributes:
        credential_id: unique; never used again.
        name: of the person or program it was issued to; need not be unique.
        proof: hash of the token, or SHA-256 fingerprint of the certificate. Reveals no secret.
        made_s: time of issue.
        begins_s: start of validity. None, the default, checks none and so does not rely on the robot's clock:
            a computer without a battery-backed clock starts in the past.
        ends_s: time of expiry; None for a credential that does not expire.
        revoked_s: time of revocation, if revoked.
    """

    credential_id: str
    name: str
    role: Role
    kind: Kind
    proof: str
    made_s: int
    begins_s: int | None = None
    ends_s: int | None = None
    revoked_s: int | None = None

    def __str__(self) -> str:
        """Returns what logs name: the owner, the role and the ID, nothing secret."""
        return f"{self.name} ({self.role.value}, {self.credential_id})"

    def validity(self, now_s: float) -> Validity:
        """Returns the validity at `now_s`; revocation takes precedence."""
        if self.revoked_s is not None:
            return Validity.REVOKED
        if self.ends_s is not None and now_s >= self.ends_s:
            return Validity.EXPIRED
        if self.begins_s is not None and now_s < self.begins_s:
            return Validity.NOT_YET
        return Validity.VALID


@dataclass(frozen=True, slots=True)
class Principal:
    """An authenticated caller.

    Attributes:
        name: as on the credentials.
        role: the lowest role of the credentials.
        credential_ids: the credentials presented; all must remain valid.
    """

    name: str
    role: Role
    credential_ids: tuple[str, ...]
