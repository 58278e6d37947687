"""Administration of a robot's credentials: initialize, add, revoke, rotate."""

import stat
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

from common.ca import (
    certificate_info,
    issue_client_certificate,
    issue_server_certificate,
    new_ca,
)
from common.errors import UserError
from common.private_files import directory_lock, write_all_private
from gateway.access.command import credentials_command
from gateway.access.credential import Credential, Kind, Validity
from gateway.access.directory import CredentialDirectory, read_public
from gateway.access.login_bundle import LoginBundle
from gateway.access.role import Role
from gateway.access.store import Store, check_name, store_text
from gateway.access.token import hash_of, new_id, new_token

_CA_DAYS: Final = 3650.0
_SERVER_DAYS: Final = 825.0
"""The longest lifetime that all current TLS libraries accept."""
_CLIENT_DAYS: Final = 365.0
_DAY_S: Final = 86_400
_WRITABLE_BY_OTHERS: Final = stat.S_IWGRP | stat.S_IWOTH

Issued: TypeAlias = tuple[Credential, LoginBundle]


@dataclass(frozen=True, slots=True)
class CredentialRequest:
    """A credential to be issued.

    Attributes:
        name: of the person or program.
        begins_s: start of validity, seconds since 1970; None for immediately.
        days: of validity; None for a token that does not expire, or a certificate valid for a year.
    """

    name: str
    role: Role
    kind: Kind = Kind.TOKEN
    begins_s: int | None = None
    days: float | None = None


@dataclass(frozen=True, slots=True)
class CredentialAdmin:
    """Changes the credential directory of one robot.

    Attributes:
        robot: name of the gateway.
        clock: calendar time, seconds since 1970.
    """

    directory: CredentialDirectory
    robot: str
    clock: Callable[[], float] = time.time

    def initialize(self, hosts: Iterable[str], *, again: bool = False) -> None:
        """Creates the CA, the server certificate and an empty list.

        Args:
            hosts: names and addresses that clients connect to.
            again: replaces existing credentials, which become invalid.

        Raises:
            UserError: there are credentials already, others may write to the directory, or a file can't be
                written.
        """
        directory = self.directory
        if directory.path.exists() and directory.path.stat().st_mode & _WRITABLE_BY_OTHERS:
            raise UserError(
                f"other users may write to {directory.path}, so that they could replace its files",
                f"Type: chmod 700 {directory.path}, or choose another directory",
            )
        with directory_lock(directory.path):
            if directory.store_file.exists() and not again:
                listing = credentials_command("list", directory.path)
                raise UserError(
                    f"{directory.path} already has credentials",
                    f"Type: {listing}; with --again all of them are discarded",
                )
            self._replace_all(hosts, Store())

    def add(self, request: CredentialRequest) -> Issued:
        """Issues a credential. Its secret is in the login bundle alone.

        Raises:
            UserError: the name is not allowed, the list is full, or it can't be written.
        """
        check_name(request.name)

        def change(store: Store) -> tuple[Store, Issued]:
            # Under the lock: a login with a CA that is being replaced would be worth nothing.
            issued = self._issue(request)
            return store.adding(issued[0]), issued

        return self.directory.change_store(change)

    def revoke(self, name_or_id: str) -> tuple[Credential, ...]:
        """Revokes all credentials of a name, or the one of an id, and returns them.

        Raises:
            UserError: no valid credential has this name or id.
        """
        now_s = int(self.clock())

        def change(store: Store) -> tuple[Store, tuple[Credential, ...]]:
            found = store.find(name_or_id, now_s, self.directory.path)
            return store.revoking(found, now_s), found

        return self.directory.change_store(change)

    def rotate(self, name_or_id: str, overlap_s: int = 0) -> Issued:
        """Issues a new secret for the name and role of a credential, which becomes invalid.

        Args:
            name_or_id: of the credential; must be unambiguous.
            overlap_s: seconds for which the old credential remains valid.

        Raises:
            UserError: no valid credential has this name or id, or several do.
        """
        now_s = int(self.clock())

        def change(store: Store) -> tuple[Store, Issued]:
            found = store.find(name_or_id, now_s, self.directory.path)
            if len(found) > 1:
                ids = ", ".join(each.credential_id for each in found)
                raise UserError(f"{name_or_id} has {len(found)} credentials: {ids}", "Give the id of one")
            (old,) = found
            lifetime_s = None if old.ends_s is None else old.ends_s - max(old.made_s, old.begins_s or 0)
            days = None if lifetime_s is None else lifetime_s / _DAY_S
            issued = self._issue(CredentialRequest(old.name, old.role, old.kind, days=days))
            ended = store.expiring(found, now_s + overlap_s) if overlap_s else store.revoking(found, now_s)
            return ended.adding(issued[0]), issued

        return self.directory.change_store(change)

    def rotate_server(self, hosts: Iterable[str] | None) -> tuple[str, ...]:
        """Issues a new server certificate. Clients need no change.

        Args:
            hosts: names and addresses that clients connect to; None for those of the present certificate.

        Returns:
            The names and addresses of the certificate.

        Raises:
            UserError: the CA or the present certificate can't be read, or the new one can't be written.
        """
        directory = self.directory
        with directory.locked():
            known = tuple(hosts) if hosts is not None else self._hosts()
            server = issue_server_certificate(directory.ca.read(), self.robot, known, _SERVER_DAYS)
            write_all_private(directory.server.contents(server))
        return known

    def rotate_ca(self, hosts: Iterable[str] | None) -> tuple[Credential, ...]:
        """Creates a new CA and server certificate. Every client needs the new CA; tokens remain valid.

        Returns:
            The client certificates, which are revoked because the new CA has not signed them.

        Raises:
            UserError: as `rotate_server`.
        """
        directory, now_s = self.directory, int(self.clock())
        with directory.locked():
            store = directory.read_store()
            revoked = tuple(
                each
                for each in store.credentials.values()
                if each.kind is Kind.CERTIFICATE
                and each.validity(now_s) in (Validity.VALID, Validity.NOT_YET)
            )
            known = tuple(hosts) if hosts is not None else self._hosts()
            self._replace_all(known, store.revoking(revoked, now_s))
        return revoked

    def _replace_all(self, hosts: Iterable[str], store: Store) -> None:
        ca = new_ca(self.robot, _CA_DAYS)
        server = issue_server_certificate(ca, self.robot, hosts, _SERVER_DAYS)
        directory = self.directory
        # The server's first: after a crash in between, `rotate server` repairs it with the CA that laptops
        # know. The list last: a directory without one is incomplete, and may be initialized again.
        write_all_private(
            directory.server.contents(server)
            | directory.ca.contents(ca)
            | {directory.store_file: store_text(store).encode()}
        )

    def _hosts(self) -> tuple[str, ...]:
        """Returns those of the present certificate, whether or not it still has its key."""
        files = self.directory.server
        try:
            return certificate_info(read_public(files.certificate, files.name)).hosts
        except ValueError as error:
            raise UserError(
                f"{files.certificate} can't be parsed: {error}", "Name the hosts: --host"
            ) from error

    def _issue(self, request: CredentialRequest) -> Issued:
        now_s, credential_id, begins_s = int(self.clock()), new_id(), request.begins_s
        certificate = request.kind is Kind.CERTIFICATE
        days = _CLIENT_DAYS if request.days is None and certificate else request.days
        ends_s = None if days is None else int((begins_s or now_s) + days * _DAY_S)
        ca = self.directory.ca.read()
        client, token = None, ""
        if certificate:
            # From the issue on, not from `begins_s`: the list alone checks the start of validity.
            client = issue_client_certificate(ca, request.name, ((ends_s or now_s) - time.time()) / _DAY_S)
            proof = certificate_info(client.certificate).fingerprint
        else:
            secret = new_token(credential_id)
            token, proof = secret.text(), hash_of(secret)
        name, role = request.name, request.role
        credential = Credential(
            credential_id, name, role, request.kind, proof, now_s, begins_s=begins_s, ends_s=ends_s
        )
        return credential, LoginBundle(name, role.value, self.robot, ca.certificate, token, client)
