"""One credential: who shows it, what it allows, how long; and the caller that it makes."""

from dataclasses import dataclass
from enum import Enum

from gateway.access.role import Role


class Kind(Enum):
    """How somebody proves who they are."""

    TOKEN = "token"
    CERTIFICATE = "certificate"


class State(Enum):
    """What a credential is worth at one instant."""

    VALID = "valid"
    NOT_YET = "not yet valid"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True, slots=True)
class Credential:
    """What the robot keeps of it; instants are seconds of the calendar clock since 1970 (UTC).

    Attributes:
        credential_id: of this one alone; it is never used again.
        name: of the person or the program that it was made for. Several may have the same.
        proof: of a token its hash, of a certificate its SHA-256 fingerprint. No secret follows from it.
        made_s: when.
        begins_s: not valid before; None when it was valid at once. No more than that is asked of the
            robot's clock by default, because a computer without a battery for it starts in the past.
        ends_s: not valid from then on; None for a credential that does not end by itself.
        revoked_s: when it was revoked.
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

    def state(self, now_s: float) -> State:
        """What it is worth now."""
        if self.revoked_s is not None:
            return State.REVOKED
        if self.ends_s is not None and now_s >= self.ends_s:
            return State.EXPIRED
        if self.begins_s is not None and now_s < self.begins_s:
            return State.NOT_YET
        return State.VALID


@dataclass(frozen=True, slots=True)
class Principal:
    """Somebody who has proved who they are.

    Attributes:
        name: as the robot's keeper called them.
        role: what they may do.
        credential_ids: by what they proved it; all must stay valid.
    """

    name: str
    role: Role
    credential_ids: tuple[str, ...]
