"""Bearer tokens: 256 random bits, of which the robot keeps a hash.

A slow hash (argon2, scrypt) protects secrets that people choose, because these can be guessed from a list.
Nobody guesses 256 random bits, so SHA-256 protects them as well, in a microsecond: a token is looked at in
every call, and a slow hash would let anybody keep the robot busy by sending wrong ones.
"""

import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass, field
from typing import Final

_FORM: Final = re.compile(r"rgt-([0-9a-f]{12})\.([A-Za-z0-9_-]{43})")
_ID_BYTES: Final = 6
_SECRET_BYTES: Final = 32
_CONTEXT: Final = b"robot-gateway token 1"
"""The hash is of no use where somebody hashes the same secret for another purpose."""
_NOBODY: Final = "0" * 64
"""The hash that a token is compared with when nobody has its id."""


@dataclass(frozen=True, slots=True)
class Token:
    """What a caller shows.

    Attributes:
        credential_id: says whose it is; no secret.
        secret: proves it. Not in the `repr`.
    """

    credential_id: str
    secret: str = field(repr=False)

    def text(self) -> str:
        """As it is shown: the only form in which it ever leaves."""
        return f"rgt-{self.credential_id}.{self.secret}"


def new_id() -> str:
    """For a new credential of any kind."""
    return secrets.token_hex(_ID_BYTES)


def new_token(credential_id: str) -> Token:
    """A token that did not exist before."""
    return Token(credential_id, secrets.token_urlsafe(_SECRET_BYTES))


def parse_token(text: str) -> Token | None:
    """The token that a text is; None when it is none of ours."""
    match = _FORM.fullmatch(text)
    return Token(match[1], match[2]) if match else None


def hash_of(token: Token) -> str:
    """What the robot keeps of it, as hexadecimal digits."""
    parts = (_CONTEXT, token.credential_id.encode(), token.secret.encode())
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def is_token(token: Token, kept_hash: str | None) -> bool:
    """Whether this is the token of which that hash is kept.

    Takes as long for a wrong one as for the right one, and as long for an id that nobody has (None).
    """
    matches = hmac.compare_digest(hash_of(token), kept_hash or _NOBODY)
    return matches and kept_hash is not None
