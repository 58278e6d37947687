"""What a robot's keeper does with credentials: begin, add, revoke, rotate."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from common.errors import UserError
from common.private_files import directory_lock
from gateway.access.authority import (
    Pair,
    certificate_facts,
    client_certificate,
    new_authority,
    server_certificate,
)
from gateway.access.bundle import Bundle
from gateway.access.command import to_type
from gateway.access.credential import Credential, Kind, State
from gateway.access.directory import CredentialDirectory
from gateway.access.role import Role
from gateway.access.store import Store, check_name
from gateway.access.token import hash_of, new_id, new_token

AUTHORITY_DAYS: Final = 3650.0
SERVER_DAYS: Final = 825.0
"""As long as all browsers and libraries put up with."""
CLIENT_DAYS: Final = 365.0
_DAY_S: Final = 86_400


@dataclass(frozen=True, slots=True)
class Wanted:
    """A credential that somebody is to have.

    Attributes:
        name: of the person or the program.
        begins_s: not valid before, seconds since 1970; None: at once.
        days: how long it is valid; None: until it is revoked (a certificate: a year).
    """

    name: str
    role: Role
    kind: Kind = Kind.TOKEN
    begins_s: int | None = None
    days: float | None = None


class Keeper:
    """Changes one robot's directory of credentials.

    Args:
        directory: where.
        robot: the gateway's name.
        clock: the calendar clock.
    """

    def __init__(
        self, directory: CredentialDirectory, robot: str, clock: Callable[[], float] = time.time
    ) -> None:
        self._directory = directory
        self._robot = robot
        self._clock = clock

    def begin(self, hosts: Iterable[str], *, again: bool = False) -> None:
        """Makes authority, server certificate and an empty list.

        Args:
            hosts: by which the gateway is called.
            again: whether all that there was may be worth nothing afterwards.

        Raises:
            UserError: there is something already, or it can't be written.
        """
        directory = self._directory
        with directory_lock(directory.path):
            if directory.store_file.exists() and not again:
                raise UserError(
                    f"{directory.path} has credentials already",
                    f"Type: {to_type('list')}; with --again all of them are thrown away",
                )
            directory.path.chmod(0o700)
            authority = new_authority(self._robot, AUTHORITY_DAYS)
            directory.write_authority(authority)
            directory.write_server(server_certificate(authority, self._robot, hosts, SERVER_DAYS))
            # Last: a directory without a list is one that was never finished, and may be begun again.
            directory.write_store(Store())

    def add(self, wanted: Wanted) -> tuple[Credential, Bundle]:
        """Makes a credential. Its secret is in the bundle and nowhere else.

        Raises:
            UserError: the name won't do, there are too many, or it can't be written.
        """
        check_name(wanted.name)
        credential, bundle = self._made(wanted)
        self._directory.change_store(lambda store: store.with_one_more(credential))
        return credential, bundle

    def revoke(self, name_or_id: str) -> tuple[Credential, ...]:
        """Everything of that name, or the one of that id, is worth nothing from now on.

        Raises:
            UserError: nothing in force is called so.
        """
        now_s = int(self._clock())
        meant: list[Credential] = []

        def change(store: Store) -> Store:
            meant.extend(store.found(name_or_id, now_s))
            return store.revoked(meant, now_s)

        self._directory.change_store(change)
        return tuple(meant)

    def rotate(self, name_or_id: str, overlap_s: int = 0) -> tuple[Credential, Bundle]:
        """A new secret in place of the old one, for the same name and role.

        Args:
            name_or_id: whose; there must be only one.
            overlap_s: how long the old one stays valid.

        Raises:
            UserError: nothing in force is called so, or more than one.
        """
        now_s = int(self._clock())
        made: list[tuple[Credential, Bundle]] = []

        def change(store: Store) -> Store:
            meant = store.found(name_or_id, now_s)
            if len(meant) > 1:
                ids = ", ".join(each.credential_id for each in meant)
                raise UserError(f"{name_or_id} has {len(meant)} credentials: {ids}", "Name one by its id")
            (old,) = meant
            lasted_s = None if old.ends_s is None else old.ends_s - max(old.made_s, old.begins_s or 0)
            days = None if lasted_s is None else lasted_s / _DAY_S
            made.append(self._made(Wanted(old.name, old.role, old.kind, days=days)))
            gone = store.ending(meant, now_s + overlap_s) if overlap_s else store.revoked(meant, now_s)
            return gone.with_one_more(made[0][0])

        self._directory.change_store(change)
        return made[0]

    def rotate_server(self, hosts: Iterable[str] | None) -> tuple[str, ...]:
        """A new certificate for the gateway. Laptops need nothing.

        Args:
            hosts: None: those of the present one.

        Returns:
            By which names and addresses the gateway may be called.

        Raises:
            UserError: there is nothing to begin with, or it can't be written.
        """
        directory = self._directory
        authority = directory.read_authority()
        with directory_lock(directory.path):
            known = tuple(hosts) if hosts is not None else self._hosts()
            directory.write_server(server_certificate(authority, self._robot, known, SERVER_DAYS))
        return known

    def rotate_authority(self, hosts: Iterable[str] | None) -> tuple[Credential, ...]:
        """A new authority and server certificate: every laptop needs the new authority, tokens stay.

        Returns:
            Client certificates, which are revoked: the new authority has not signed them.

        Raises:
            UserError: as `rotate_server`.
        """
        directory, now_s = self._directory, int(self._clock())
        known = tuple(hosts) if hosts is not None else self._hosts()
        authority = new_authority(self._robot, AUTHORITY_DAYS)
        over: list[Credential] = []

        def without_certificates(store: Store) -> Store:
            over.extend(
                each
                for each in store.credentials.values()
                if each.kind is Kind.CERTIFICATE and each.state(now_s) in (State.VALID, State.NOT_YET)
            )
            return store.revoked(over, now_s)

        directory.change_store(without_certificates)
        with directory_lock(directory.path):
            directory.write_authority(authority)
            directory.write_server(server_certificate(authority, self._robot, known, SERVER_DAYS))
        return tuple(over)

    def authority_bundle(self) -> Bundle:
        """What a laptop needs that has a token and an old authority."""
        return Bundle("", "", self._robot, self._directory.read_authority().certificate)

    def _hosts(self) -> tuple[str, ...]:
        return certificate_facts(self._directory.read_server().certificate).hosts

    def _made(self, wanted: Wanted) -> tuple[Credential, Bundle]:
        now_s, credential_id = int(self._clock()), new_id()
        begins_s = wanted.begins_s
        days = wanted.days
        if days is None and wanted.kind is Kind.CERTIFICATE:
            days = CLIENT_DAYS
        ends_s = None if days is None else int((begins_s or now_s) + days * _DAY_S)
        authority = self._directory.read_authority()
        client: Pair | None = None
        token = ""
        if wanted.kind is Kind.CERTIFICATE:
            valid_days = ((ends_s or now_s) - time.time()) / _DAY_S
            client = client_certificate(authority, wanted.name, valid_days)
            proof = certificate_facts(client.certificate).fingerprint
        else:
            secret = new_token(credential_id)
            token, proof = secret.text(), hash_of(secret)
        credential = Credential(
            credential_id, wanted.name, wanted.role, wanted.kind, proof, now_s, begins_s, ends_s
        )
        bundle = Bundle(
            wanted.name, wanted.role.value, self._robot, authority.certificate, token=token, client=client
        )
        return credential, bundle
