"""Bearer tokens (RFC 6750): 256 random bits, of which the robot stores a hash.

Slow hashes (argon2, scrypt) protect secrets that people choose, which can be guessed from a list. 256 random
bits can't be guessed, so SHA-256 suffices. It takes a microsecond, and every call verifies a token: with a
slow hash, wrong tokens would be enough to overload the robot.
"""

import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass, field
from typing import Final

_FORMAT: Final = re.compile(r"rgt-([0-9a-f]{12})\.([A-Za-z0-9_-]{43})")
_ID_BYTES: Final = 6
_SECRET_BYTES: Final = 32
_CONTEXT: Final = b"robot-gateway token 1"
"""Domain separation: a hash of the same secret for another purpose differs."""
_NO_HASH: Final = "0" * 64
"""Compared with if the credential id is unknown."""


@dataclass(frozen=True, slots=True)
class Token:
    """A bearer token.

    Attributes:
        credential_id: the credential it belongs to; not secret.
        secret: excluded from the `repr`.
    """

    credential_id: str
    secret: str = field(repr=False)

    def text(self) -> str:
        """Encodes the token for the authorization header."""
        return f"rgt-{self.credential_id}.{self.secret}"


def new_id() -> str:
    """Returns a random id for a credential of any kind."""
    return secrets.token_hex(_ID_BYTES)


def new_token(credential_id: str) -> Token:
    """Returns a token with a random secret."""
    return Token(credential_id, secrets.token_urlsafe(_SECRET_BYTES))


def parse_token(text: str) -> Token | None:
    """Decodes a token; returns None for any other text."""
    match = _FORMAT.fullmatch(text)
    return Token(match[1], match[2]) if match else None


def hash_of(token: Token) -> str:
    """Returns the hash that the robot stores, as 64 hexadecimal digits."""
    parts = (_CONTEXT, token.credential_id.encode(), token.secret.encode())
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def verify(token: Token, stored_hash: str | None) -> bool:
    """Returns whether the token has this hash; None stands for an unknown credential id.

    Takes the same time for right tokens, wrong tokens and unknown ids (constant-time comparison).
    """
    matches = hmac.compare_digest(hash_of(token), stored_hash or _NO_HASH)
    return matches and stored_hash is not None
