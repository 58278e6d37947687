"""The list of credentials as an immutable value, and its JSON encoding. Knows no file."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.errors import UserError
from gateway.access.command import credentials_command
from gateway.access.credential import Credential, Kind, Validity
from gateway.access.role import Role

MAX_CREDENTIALS: Final = 512
"""In one list, including revoked and expired ones."""
_VERSION: Final = 1
_NAME: Final = r"[A-Za-z0-9][A-Za-z0-9._@-]{0,62}"
_RESERVED: Final = frozenset({"ca", "server"})
"""What `rotate` takes in place of a name."""


@dataclass(frozen=True, slots=True)
class Store:
    """All credentials of a robot by id, in order of issue."""

    credentials: Mapping[str, Credential] = field(default_factory=lambda: MappingProxyType({}))

    def adding(self, credential: Credential) -> "Store":
        """Returns a list with one more credential; if full, the one revoked first is dropped.

        Raises:
            UserError: the list is full and none is revoked.
        """
        kept = dict(self.credentials)
        if len(kept) >= MAX_CREDENTIALS:
            revoked = [each for each in kept.values() if each.revoked_s is not None]
            if not revoked:
                raise UserError(f"this robot has {len(kept)} credentials, which is the limit", "Revoke some")
            del kept[min(revoked, key=lambda each: each.revoked_s or 0).credential_id]
        kept[credential.credential_id] = credential
        return Store(MappingProxyType(kept))

    def find(self, name_or_id: str, now_s: float, directory: Path | None = None) -> tuple[Credential, ...]:
        """Returns the credentials of a name or id that are neither revoked nor expired.

        Args:
            name_or_id: of the credentials.
            now_s: Unix time.
            directory: of the list, for the error.

        Raises:
            UserError: there are none.
        """
        found = tuple(
            each
            for each in self.credentials.values()
            if name_or_id in (each.name, each.credential_id)
            and each.validity(now_s) not in (Validity.REVOKED, Validity.EXPIRED)
        )
        if not found:
            raise UserError(
                f"no valid credential has the name or id '{name_or_id}'",
                f"To list all of them, type: {credentials_command('list', directory)}",
            )
        return found

    def revoking(self, which: Iterable[Credential], now_s: int) -> "Store":
        """Returns a list with the given credentials revoked."""
        return self._changed(replace(each, revoked_s=now_s) for each in which)

    def expiring(self, which: Iterable[Credential], ends_s: int) -> "Store":
        """Returns a list in which the given credentials expire at `ends_s` at the latest."""
        return self._changed(
            replace(each, ends_s=ends_s if each.ends_s is None else min(ends_s, each.ends_s))
            for each in which
        )

    def changes_since(self, before: "Store") -> Iterator[str]:
        """Yields one phrase per credential that was added, changed, revoked or dropped, without secrets."""
        for credential_id, each in self.credentials.items():
            known = before.credentials.get(credential_id)
            if each == known:
                continue
            verb = "added" if known is None else "changed"
            if each.revoked_s is not None and (known is None or known.revoked_s is None):
                verb = "revoked"
            yield f"{verb} {each}"
        for credential_id in before.credentials.keys() - self.credentials.keys():
            yield f"dropped {before.credentials[credential_id]}"

    def _changed(self, changed: Iterable[Credential]) -> "Store":
        return Store(MappingProxyType({**self.credentials, **{each.credential_id: each for each in changed}}))


def check_name(name: str) -> str:
    """Returns the name if a credential may have it.

    Raises:
        UserError: it has other characters, is too long, or means a certificate of the robot.
    """
    if not re.fullmatch(_NAME, name):
        raise UserError(
            f"'{name}' can't be the name on a credential",
            "Use up to 63 letters, digits, . _ @ and -, starting with a letter or digit",
        )
    if name in _RESERVED:
        raise UserError(
            f"'{name}' can't be the name on a credential: `rotate {name}` is a certificate",
            "Use another name",
        )
    return name


_Instant: TypeAlias = Annotated[int, Field(ge=0)]


class _Entry(BaseModel):
    """The JSON encoding of a credential. Every key is required: a missing "revoked" must not mean valid."""

    model_config = ConfigDict(extra="forbid", strict=True)

    credential_id: Annotated[str, Field(alias="id", pattern=r"^[0-9a-f]{12}$")]
    name: Annotated[str, Field(pattern=f"^{_NAME}$")]
    role: Role
    kind: Kind
    proof: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    made_s: Annotated[_Instant, Field(alias="made")]
    begins_s: Annotated[_Instant | None, Field(alias="begins")]
    ends_s: Annotated[_Instant | None, Field(alias="ends")]
    revoked_s: Annotated[_Instant | None, Field(alias="revoked")]


class _Document(BaseModel):
    model_config = ConfigDict(strict=True)

    version: Literal[1]
    credentials: Annotated[list[_Entry], Field(max_length=MAX_CREDENTIALS)]


def store_text(store: Store) -> str:
    """Encodes the list as JSON; it contains no secret."""
    entries = [asdict(each) for each in store.credentials.values()]
    document = _Document.model_validate(
        {"version": _VERSION, "credentials": entries}, by_name=True, by_alias=False
    )
    return document.model_dump_json(by_alias=True, indent=1) + "\n"


def parse_store(text: str) -> Store:
    """Decodes a list.

    Raises:
        ValueError: it is malformed or invalid; the message quotes nothing of it.
    """
    try:
        document = _Document.model_validate_json(text)
    except ValidationError as error:
        raise ValueError(_problem(error)) from error
    by_id = {each.credential_id: Credential(**dict(each)) for each in document.credentials}
    if len(by_id) != len(document.credentials):
        raise ValueError("two credentials have the same id")
    return Store(MappingProxyType(by_id))


def _problem(error: ValidationError) -> str:
    match error.errors(include_input=False, include_url=False)[0]["loc"]:
        case ("credentials", int(index), *_):
            return f"credential {index + 1} is invalid"
        case _:
            return f"it is not a list of up to {MAX_CREDENTIALS} credentials in version {_VERSION}"
