"""What the operator wants of the preview."""

from dataclasses import dataclass, field

from gateway.status.preview import Profile


@dataclass(frozen=True, slots=True)
class Wish:
    """One wish; two with the same revision are the same.

    Attributes:
        profile: None when none was ever chosen, which no enabled wish has.
        passphrase: of the session, from enable to disable; empty for a stream that is not encrypted.
        request_id: of the request that asked for it, for the logs; empty when none did.
    """

    revision: int
    enabled: bool
    profile: Profile | None
    passphrase: str = field(default="", repr=False)
    request_id: str = ""
