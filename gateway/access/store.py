"""The document of credentials as values: read strictly, changed as a whole. Knows no file."""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

from common.errors import UserError
from gateway.access.command import to_type
from gateway.access.credential import Credential, Kind, State
from gateway.access.role import Role

MOST: Final = 512
"""Credentials in one document, those included that are over."""
_VERSION: Final = 1
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,62}")
_ID: Final = re.compile(r"[0-9a-f]{12}")
_PROOF: Final = re.compile(r"[0-9a-f]{64}")
_KEYS: Final = frozenset({"id", "name", "role", "kind", "proof", "made", "begins", "ends", "revoked"})


@dataclass(frozen=True, slots=True)
class Store:
    """All credentials of a robot by their ids, the oldest first."""

    credentials: Mapping[str, Credential] = field(default_factory=lambda: MappingProxyType({}))

    def with_one_more(self, credential: Credential) -> "Store":
        """The same and this one. What has been over the longest makes room.

        Raises:
            UserError: there are too many that are not over.
        """
        kept = dict(self.credentials)
        if len(kept) >= MOST:
            over = [each for each in kept.values() if each.revoked_s is not None]
            if not over:
                raise UserError(f"{len(kept)} credentials are as many as one robot has", "Revoke some")
            del kept[min(over, key=lambda each: each.revoked_s or 0).credential_id]
        kept[credential.credential_id] = credential
        return Store(MappingProxyType(kept))

    def found(self, name_or_id: str, now_s: float) -> tuple[Credential, ...]:
        """Those that a person means, without those that are over.

        Raises:
            UserError: there are none.
        """
        over = (State.REVOKED, State.EXPIRED)
        meant = tuple(
            each
            for each in self.credentials.values()
            if name_or_id in (each.name, each.credential_id) and each.state(now_s) not in over
        )
        if not meant:
            raise UserError(
                f"no credential in force has the name or the id '{name_or_id}'",
                f"{to_type('list')} has all of them",
            )
        return meant

    def revoked(self, which: Iterable[Credential], now_s: int) -> "Store":
        """The same with those revoked."""
        return self._changed({each.credential_id: replace(each, revoked_s=now_s) for each in which})

    def ending(self, which: Iterable[Credential], ends_s: int) -> "Store":
        """The same with those ending then, unless they end earlier anyway."""
        changed = {}
        for each in which:
            ends = ends_s if each.ends_s is None else min(ends_s, each.ends_s)
            changed[each.credential_id] = replace(each, ends_s=ends)
        return self._changed(changed)

    def _changed(self, changed: Mapping[str, Credential]) -> "Store":
        return Store(MappingProxyType({**self.credentials, **changed}))


def check_name(name: str) -> str:
    """The name, if somebody may be called so.

    Raises:
        UserError: it may not.
    """
    if not _NAME.fullmatch(name):
        raise UserError(
            f"'{name}' can't be the name on a credential",
            "Take up to 63 letters, digits, . _ @ and -, the first a letter or a digit",
        )
    return name


def store_text(store: Store) -> str:
    """As it is kept: JSON for people and programs, without any secret."""
    listed = [
        {
            "id": each.credential_id,
            "name": each.name,
            "role": each.role.value,
            "kind": each.kind.value,
            "proof": each.proof,
            "made": each.made_s,
            "begins": each.begins_s,
            "ends": each.ends_s,
            "revoked": each.revoked_s,
        }
        for each in store.credentials.values()
    ]
    return json.dumps({"version": _VERSION, "credentials": listed}, indent=1) + "\n"


def parse_store(text: str) -> Store:
    """The credentials that a text holds.

    Raises:
        ValueError: it is none of ours; the words quote nothing out of it.
    """
    try:
        document = json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(document, dict) or document.get("version") != _VERSION:
        raise ValueError(f"it is not a document of version {_VERSION}")
    listed = document.get("credentials")
    if not isinstance(listed, list) or len(listed) > MOST:
        raise ValueError(f"it does not list up to {MOST} credentials")
    credentials = [_credential(number, each) for number, each in enumerate(listed, 1)]
    by_id = {each.credential_id: each for each in credentials}
    if len(by_id) != len(credentials):
        raise ValueError("two credentials have the same id")
    return Store(MappingProxyType(by_id))


def _credential(number: int, value: Any) -> Credential:
    try:
        if set(value) != _KEYS:
            raise ValueError("keys")  # noqa: TRY301  # one way out for all that may be wrong
        return Credential(
            credential_id=_text(_ID, value["id"]),
            name=_text(_NAME, value["name"]),
            role=Role(value["role"]),
            kind=Kind(value["kind"]),
            proof=_text(_PROOF, value["proof"]),
            made_s=_instant(value["made"]) or 0,
            begins_s=_instant(value["begins"]),
            ends_s=_instant(value["ends"]),
            revoked_s=_instant(value["revoked"]),
        )
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"credential {number} is not in order") from error


def _text(form: re.Pattern[str], value: Any) -> str:
    if not form.fullmatch(value):
        raise ValueError("text")
    return str(value)


def _instant(value: Any) -> int | None:
    if value is None:
        return None
    if type(value) is not int or value < 0:
        raise ValueError("instant")
    return value
