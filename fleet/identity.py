"""Identities in the scheme of NATS: Ed25519 keys (nkeys) and the tokens that they sign (JWT, version 2).

An operator signs accounts, an account signs its users, and a user proves by its key that a token is its own.
Servers know the operator's public key only: a robot is enrolled without touching them.
"""

import base64
import hashlib
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

import nkeys

from fleet.errors import RefusedError

_JWT_LINE: Final = "-----BEGIN NATS USER JWT-----"
_SEED_LINE: Final = "-----BEGIN USER NKEY SEED-----"
_UNLIMITED: Final = -1


class KeyKind(IntEnum):
    """What a key stands for; the first letter of its public form shows it: O, A, U."""

    OPERATOR = nkeys.PREFIX_BYTE_OPERATOR
    ACCOUNT = nkeys.PREFIX_BYTE_ACCOUNT
    USER = nkeys.PREFIX_BYTE_USER


@dataclass(frozen=True, slots=True)
class Key:
    """A key pair; the seed is excluded from the `repr`."""

    seed: bytes = field(repr=False)

    @classmethod
    def new(cls, kind: KeyKind) -> "Key":
        """Creates a key."""
        return cls(nkeys.encode_seed(os.urandom(32), kind))

    @property
    def public(self) -> str:
        """The public key, as tokens and servers name it."""
        return str(nkeys.from_seed(bytearray(self.seed)).public_key.decode())

    def sign(self, content: bytes) -> bytes:
        """Returns the Ed25519 signature of a content.

        Raises:
            RefusedError: the seed is none.
        """
        try:
            return bytes(nkeys.from_seed(bytearray(self.seed)).sign(content))
        except (nkeys.NkeysError, ValueError) as error:
            raise RefusedError("the credentials have no valid seed") from error


@dataclass(frozen=True, slots=True)
class Credentials:
    """Contents of a .creds file: a user's token and its key."""

    jwt: str
    key: Key

    @classmethod
    def read(cls, path: Path) -> "Credentials":
        """Parses a .creds file.

        Raises:
            RefusedError: it can't be read, or is none.
        """
        try:
            lines = path.read_text(encoding="ascii").splitlines()
            jwt, seed = (lines[lines.index(line) + 1].strip() for line in (_JWT_LINE, _SEED_LINE))
        except OSError as error:
            raise RefusedError(f"the credentials {path} can't be read: {error.strerror}") from error
        except (ValueError, IndexError) as error:
            raise RefusedError(
                f"{path} contains no credentials: expected a file made by enrolling"
            ) from error
        return cls(jwt, Key(seed.encode()))

    def text(self) -> str:
        """Returns the file's content."""
        return (
            f"{_JWT_LINE}\n{self.jwt}\n------END NATS USER JWT------\n\n"
            f"{_SEED_LINE}\n{self.key.seed.decode()}\n------END USER NKEY SEED------\n"
        )


@dataclass(frozen=True, slots=True)
class Permissions:
    """What a user may do. What is not named is refused.

    Attributes:
        publish: subjects that it may publish to.
        subscribe: subjects that it may subscribe to, "subject queue" with a queue group.
        respond_s: for how long it may answer a request on the request's own reply subject; 0: not at all.
        subscriptions: at any moment.
        payload: largest message that it may publish, in bytes.
    """

    publish: tuple[str, ...]
    subscribe: tuple[str, ...]
    respond_s: int = 0
    subscriptions: int = _UNLIMITED
    payload: int = _UNLIMITED


def operator_jwt(operator: Key, name: str, system_account: str) -> str:
    """Returns the operator's token, which servers are configured with."""
    claims = {"type": "operator", "system_account": system_account}
    return _signed(operator, operator.public, name, claims)


@dataclass(frozen=True, slots=True)
class Service:
    """Requests that one account takes from another.

    Attributes:
        subject: of the requests.
        many: whether a request has several answers.
        local: the subject in the importing account, with $1 for the first wildcard; empty for the same.
            Needed where that account serves the same subject itself, as each does with JetStream's API.
    """

    subject: str
    many: bool = False
    local: str = ""


@dataclass(frozen=True, slots=True)
class Account:
    """What an account's token says.

    Attributes:
        name: for people.
        stores: whether it may use JetStream.
        exports: requests that it takes from other accounts.
        imports: requests that its users may send to another account, with that one's public key.
        connections: at any moment, at all servers together.
        revoked: users by public key, with the time in s since 1970 up to which their tokens are not valid.
    """

    name: str
    stores: bool = False
    exports: tuple[Service, ...] = ()
    imports: tuple[tuple[str, Service], ...] = ()
    connections: int = _UNLIMITED
    revoked: Mapping[str, int] = field(default_factory=dict)


def account_jwt(operator: Key, public: str, account: Account, *, issued_unix_s: int) -> str:
    """Returns an account's token.

    Args:
        operator: who signs.
        public: the account's public key.
        account: what the token says.
        issued_unix_s: its time of issue. Of two tokens of an account, servers believe the one
            that was issued later, and of two that were issued in the same second any.
    """
    names = ("subs", "data", "payload", "imports", "exports", "leaf")
    stored = ("mem_storage", "disk_storage", "streams", "consumer") if account.stores else ()
    claims = {
        "type": "account",
        "limits": {
            **dict.fromkeys((*names, *stored), _UNLIMITED),
            "conn": account.connections,
            "wildcards": True,
        },
        "default_permissions": {"pub": {}, "sub": {}},
        "exports": [
            {
                "name": each.subject,
                "subject": each.subject,
                "type": "service",
                "response_type": "Stream" if each.many else "Singleton",
            }
            for each in account.exports
        ],
        "imports": [
            {
                "name": each.subject,
                "subject": each.subject,
                "account": exporter,
                "type": "service",
                **({"local_subject": each.local} if each.local else {}),
            }
            for exporter, each in account.imports
        ],
        "revocations": dict(account.revoked),
    }
    return _signed(operator, public, account.name, claims, issued_unix_s=issued_unix_s)


def user_jwt(
    account: Key, user: str, name: str, permissions: Permissions, expires_unix_s: int | None = None
) -> str:
    """Returns a user's token; without `expires_unix_s` it is valid until it is revoked."""
    claims: dict[str, Any] = {
        "type": "user",
        "pub": {"allow": list(permissions.publish)} if permissions.publish else {"deny": [">"]},
        "sub": {"allow": list(permissions.subscribe)} if permissions.subscribe else {"deny": [">"]},
        "subs": permissions.subscriptions,
        "data": _UNLIMITED,
        "payload": permissions.payload,
        "allowed_connection_types": ["STANDARD"],
    }
    if permissions.respond_s:
        claims["resp"] = {"max": _UNLIMITED, "ttl": permissions.respond_s * 1_000_000_000}
    return _signed(account, user, name, claims, expires_unix_s=expires_unix_s)


def new_user(
    account: Key, name: str, permissions: Permissions, expires_unix_s: int | None = None
) -> tuple[Credentials, str]:
    """Creates a user; returns its credentials and its public key."""
    key = Key.new(KeyKind.USER)
    return Credentials(user_jwt(account, key.public, name, permissions, expires_unix_s), key), key.public


def _signed(
    issuer: Key,
    subject: str,
    name: str,
    claims: Mapping[str, Any],
    *,
    expires_unix_s: int | None = None,
    issued_unix_s: int | None = None,
) -> str:
    content: dict[str, Any] = {
        "iat": int(time.time()) if issued_unix_s is None else issued_unix_s,
        "iss": issuer.public,
        "name": name,
        "sub": subject,
        "nats": {**claims, "version": 2},
    }
    if expires_unix_s is not None:
        content["exp"] = expires_unix_s
    digest = hashlib.new("sha512_256", _json(content)).digest()
    content["jti"] = base64.b32encode(digest).decode().rstrip("=")
    head = _base64(_json({"typ": "JWT", "alg": "ed25519-nkey"}))
    signed = f"{head}.{_base64(_json(content))}"
    return f"{signed}.{_base64(issuer.sign(signed.encode()))}"


def _json(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":"), sort_keys=True).encode()


def _base64(content: bytes) -> str:
    return base64.urlsafe_b64encode(content).decode().rstrip("=")
