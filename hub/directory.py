"""The hub's directory: keys, certificates, and the list of what was issued. It has power over the fleet.

It stays with the administrator; the servers get `nodes/<n>` alone.

| file | what |
|---|---|
| hub.json | the fleet's name, the servers, replicas, and each user with its public key |
| keys/*.nk | seeds: of the operator, and of the accounts (hub/accounts.py) |
| keys/ca.pem, ca.key | the authority of the servers' certificates |
| receipts.key, receipts.pub | what receivers sign receipts with, and what robots check them with |
| admin.creds, system.creds | credentials of the administration |
| nodes/<n>/ | configuration, certificate and tokens of one server |
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, Self

from common.errors import ExitCode, UserError
from common.private_files import directory_lock, write_private
from fleet.connection import FleetAddress
from fleet.identity import Key
from fleet.names import ROBOT_NAME

Kind = Literal["robot", "operator", "receiver"]
KeyName = Literal["operator", "fleet", "robots", "people", "commanders", "receivers", "system"]
ACCOUNTS_OF_PEOPLE: Final[tuple[KeyName, ...]] = ("people", "commanders", "receivers")
"""A hub of an earlier version lacks them: its people and receivers were in the account of the streams."""


@dataclass(frozen=True, slots=True)
class User:
    """Who has credentials of the hub.

    Attributes:
        name: of the robot, person or receiver.
        kind: which of them.
        keys: public keys that were issued; the last one is in use.
        revoked: when it was revoked, in s since 1970; None: it was not.
    """

    name: str
    kind: Kind
    keys: tuple[str, ...]
    revoked: int | None = None


@dataclass(frozen=True, slots=True)
class HubRecord:
    """What hub.json says.

    Attributes:
        fleet: its name.
        servers: for clients, as "tls://host:4222".
        replicas: nodes that keep each message.
        users: no two with the same kind and name.
        revoked: public keys that are not valid any more, with when they were revoked, in s since 1970.
        issued: when the newest tokens of the accounts were issued, in s since 1970.
    """

    fleet: str
    servers: tuple[str, ...]
    replicas: int
    users: tuple[User, ...] = ()
    revoked: Mapping[str, int] = field(default_factory=dict)
    issued: int = 0

    def user(self, kind: Kind, name: str) -> User | None:
        """Returns the user of this kind and name, if there is one."""
        return next((each for each in self.users if (each.kind, each.name) == (kind, name)), None)

    def with_user(self, user: User) -> Self:
        """Returns the record with this user in the place of the one with the same kind and name."""
        others = (each for each in self.users if (each.kind, each.name) != (user.kind, user.name))
        return replace(self, users=(*others, user))


def check_name(name: str) -> None:
    """Raises a UserError (usage) if a fleet, robot, person or receiver can't have this name."""
    if not ROBOT_NAME.fullmatch(name):
        raise UserError(
            f"'{name[:80]}' is no name for a robot, person or fleet",
            "Write lower-case letters, digits and hyphens, at most 63, as in DNS names",
            exit_code=ExitCode.USAGE,
        )


class HubDirectory:
    """The directory that `hub init` has made.

    Args:
        path: of it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def exists(self) -> bool:
        """Whether there is one."""
        return (self.path / "hub.json").exists()

    @property
    def ca_file(self) -> Path:
        """Certificate of the authority of the servers' certificates."""
        return self.path / "keys" / "ca.pem"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps other administrators out for the block.

        Raises:
            UserError: another one does not finish.
        """
        with directory_lock(self.path):
            yield

    def read(self) -> HubRecord:
        """Reads hub.json.

        Raises:
            UserError: there is none, or it is damaged.
        """
        try:
            values = json.loads((self.path / "hub.json").read_text(encoding="utf-8"))
            users = tuple(User(**(each | {"keys": tuple(each["keys"])})) for each in values.pop("users"))
            return HubRecord(**(values | {"servers": tuple(values["servers"]), "users": users}))
        except OSError as error:
            raise UserError(
                f"{self.path} is no hub's directory: {error.strerror}",
                "Name it with --dir, or make one: robot-bridge hub init --out DIR",
                exit_code=ExitCode.USAGE,
            ) from error
        except (ValueError, KeyError, TypeError) as error:
            raise UserError(
                f"{self.path}/hub.json is damaged: {error}", "Restore it from a backup"
            ) from error

    def write(self, record: HubRecord) -> None:
        """Replaces hub.json.

        Raises:
            UserError: it can't be written.
        """
        values: dict[str, Any] = asdict(record)
        write_private(self.path / "hub.json", json.dumps(values, indent=2).encode())

    def key(self, name: KeyName) -> Key:
        """Reads a key.

        Raises:
            UserError: it is missing.
        """
        if name in self.missing_accounts():
            raise UserError(
                f"{self.path} is a hub of an earlier version: it has no account '{name}'",
                f"Type first: robot-bridge hub apply --dir {self.path}",
            )
        return Key(self.secret(f"keys/{name}.nk").strip())

    def missing_accounts(self) -> tuple[KeyName, ...]:
        """Returns the accounts that a hub of an earlier version lacks."""
        return tuple(name for name in ACCOUNTS_OF_PEOPLE if not (self.path / "keys" / f"{name}.nk").exists())

    def secret(self, name: str) -> bytes:
        """Reads a file of the directory.

        Raises:
            UserError: it is missing.
        """
        try:
            return (self.path / name).read_bytes()
        except OSError as error:
            what = f"{self.path / name} can't be read: {error.strerror}"
            raise UserError(what, "Restore it from a backup") from error

    def address(self, credentials: Literal["admin", "system"]) -> FleetAddress:
        """Returns how the administration connects."""
        creds = self.path / f"{credentials}.creds"
        return FleetAddress(self.read().servers, creds, self.ca_file, name="robot-bridge hub")
