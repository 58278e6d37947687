"""Administration: concurrent changes are all kept; a rotated secret replaces the old one."""

import errno
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from cryptography.x509 import load_pem_x509_certificate

from common.errors import UserError
from common.private_files import directory_lock
from gateway.access.credential import Kind, Validity
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.role import Role
from gateway.access.store import Store, parse_store

NOW_S = 1_000_000.0


@pytest.fixture
def admin(tmp_path: Path) -> CredentialAdmin:
    admin = CredentialAdmin(CredentialDirectory(tmp_path), "lab", lambda: NOW_S)
    admin.initialize(("localhost",))
    return admin


def states(path: Path) -> list[tuple[str, str]]:
    """Names and states, oldest first."""
    kept = CredentialDirectory(path).read_store().credentials.values()
    return [(each.name, each.validity(NOW_S).value) for each in kept]


def test_changes_at_once_are_all_kept(admin: CredentialAdmin, tmp_path: Path) -> None:
    names = [f"person-{number}" for number in range(40)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda name: admin.add(CredentialRequest(name, Role.VIEWER)), names))
    assert sorted(name for name, _ in states(tmp_path)) == sorted(names)


def test_a_revocation_survives_a_power_loss(admin: CredentialAdmin, monkeypatch: pytest.MonkeyPatch) -> None:
    admin.add(CredentialRequest("anna", Role.OPERATOR))
    on_disk: list[tuple[str, str]] = []

    def fsync(handle: int) -> None:
        path = Path(f"/proc/self/fd/{handle}").readlink()
        what, file = ("name", path / "credentials.json") if path.is_dir() else ("content", path)
        (kept,) = parse_store(file.read_text()).credentials.values()
        on_disk.append((what, kept.validity(NOW_S).value))

    monkeypatch.setattr(os, "fsync", fsync)
    admin.revoke("anna")
    assert on_disk == [("content", "revoked"), ("name", "revoked")]


def test_a_rotated_token_replaces_the_old_one_now_or_later(admin: CredentialAdmin, tmp_path: Path) -> None:
    admin.add(CredentialRequest("anna", Role.OPERATOR))
    new, bundle = admin.rotate("anna")
    assert (new.name, new.role) == ("anna", Role.OPERATOR)
    assert bundle.token
    assert states(tmp_path) == [("anna", "revoked"), ("anna", "valid")]
    admin.rotate(new.credential_id, overlap_s=60)
    assert states(tmp_path) == [("anna", "revoked"), ("anna", "valid"), ("anna", "valid")]
    kept = CredentialDirectory(tmp_path).read_store().credentials[new.credential_id]
    assert kept.validity(NOW_S + 60) is Validity.EXPIRED


def test_who_has_two_is_asked_which(admin: CredentialAdmin) -> None:
    first, _ = admin.add(CredentialRequest("anna", Role.VIEWER))
    second, _ = admin.add(CredentialRequest("anna", Role.ADMIN))
    with pytest.raises(UserError, match=f"{first.credential_id}, {second.credential_id}"):
        admin.rotate("anna")
    assert {each.credential_id for each in admin.revoke("anna")} == {
        first.credential_id,
        second.credential_id,
    }


def test_a_rotation_lasts_as_long_as_what_it_replaces(admin: CredentialAdmin) -> None:
    admin.add(CredentialRequest("anna", Role.VIEWER, days=7))
    assert admin.rotate("anna")[0].ends_s == NOW_S + 7 * 86_400


def test_a_bundle_holds_what_the_list_does_not(admin: CredentialAdmin, tmp_path: Path) -> None:
    _, token = admin.add(CredentialRequest("anna", Role.VIEWER))
    _, certificate = admin.add(CredentialRequest("ben", Role.VIEWER, Kind.CERTIFICATE))
    listed = CredentialDirectory(tmp_path).store_file.read_text()
    assert token.token in token.text()
    assert token.token.partition(".")[2] not in listed
    assert "PRIVATE KEY" in certificate.text()
    assert "PRIVATE KEY" not in listed
    assert token.token not in repr(token)


@pytest.mark.parametrize("name", ["ca", "server"])
def test_a_name_that_rotate_takes_for_a_certificate_is_refused(admin: CredentialAdmin, name: str) -> None:
    with pytest.raises(UserError, match="another name"):
        admin.add(CredentialRequest(name, Role.VIEWER))


def test_the_permissions_of_an_existing_directory_are_left_alone(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    CredentialAdmin(CredentialDirectory(tmp_path), "lab").initialize(("localhost",))
    assert tmp_path.stat().st_mode & 0o777 == 0o755
    CredentialAdmin(CredentialDirectory(tmp_path / "new"), "lab").initialize(("localhost",))
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o700


def test_a_directory_that_others_may_write_to_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o770)
    with pytest.raises(UserError, match=f"chmod 700 {tmp_path}"):
        CredentialAdmin(CredentialDirectory(tmp_path), "lab").initialize(("localhost",))
    assert not list(tmp_path.iterdir())


def test_half_a_ca_signs_nothing_and_can_be_replaced(admin: CredentialAdmin, tmp_path: Path) -> None:
    """As after a crash between the two files."""
    files = CredentialDirectory(tmp_path)
    files.ca.key.write_bytes(files.server.key.read_bytes())
    for sign in (
        lambda: admin.add(CredentialRequest("anna", Role.VIEWER, Kind.CERTIFICATE)),
        lambda: admin.rotate_server(None),
    ):
        with pytest.raises(UserError, match=r"is not the key of .*rotate ca"):
            sign()
    admin.rotate_ca(None)
    admin.rotate_server(None)


def test_a_server_certificate_without_its_key_can_be_replaced(admin: CredentialAdmin, tmp_path: Path) -> None:
    files = CredentialDirectory(tmp_path)
    files.server.key.write_bytes(files.ca.key.read_bytes())
    with pytest.raises(UserError, match=r"is not the key of .*rotate server"):
        files.server.read()
    assert admin.rotate_server(None) == ("localhost",)
    assert files.server.read()


def test_certificates_rotated_at_once_match(admin: CredentialAdmin, tmp_path: Path) -> None:
    """The key that signs the server's certificate is the CA's that is in force."""
    files = CredentialDirectory(tmp_path)
    rotations = [lambda: admin.rotate_ca(None), lambda: admin.rotate_server(None)] * 10
    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(each) for each in rotations]:
            done.result()
    server, ca = (load_pem_x509_certificate(each.read().certificate) for each in (files.server, files.ca))
    server.verify_directly_issued_by(ca)


@pytest.mark.parametrize("kind", Kind)
def test_a_login_has_the_ca_that_is_in_force_when_it_is_listed(
    admin: CredentialAdmin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: Kind
) -> None:
    @contextmanager
    def after_another_program(directory: Path) -> Iterator[None]:
        monkeypatch.undo()
        admin.rotate_ca(None)
        with directory_lock(directory):
            yield

    monkeypatch.setattr("gateway.access.directory.directory_lock", after_another_program)
    _, bundle = admin.add(CredentialRequest("anna", Role.VIEWER, kind))
    ca = CredentialDirectory(tmp_path).ca.read().certificate
    assert bundle.ca_certificate == ca
    if bundle.client:
        client, authority = map(load_pem_x509_certificate, (bundle.client.certificate, ca))
        client.verify_directly_issued_by(authority)


def test_a_full_disk_leaves_all_certificates_as_they_were(
    admin: CredentialAdmin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def contents() -> dict[str, bytes]:
        return {each.name: each.read_bytes() for each in tmp_path.iterdir()}

    admin.add(CredentialRequest("ben", Role.VIEWER, Kind.CERTIFICATE))
    before, room = contents(), iter(range(3))

    def fsync(_handle: int) -> None:
        if next(room, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(UserError, match="No space left"):
        admin.rotate_ca(None)
    assert contents() == before


def test_a_change_that_fails_changes_nothing(admin: CredentialAdmin, tmp_path: Path) -> None:
    admin.add(CredentialRequest("anna", Role.VIEWER))
    before = CredentialDirectory(tmp_path).store_file.read_bytes()

    def fail(_store: Store) -> tuple[Store, None]:
        raise UserError("no")

    with pytest.raises(UserError, match="no"):
        CredentialDirectory(tmp_path).change_store(fail)
    assert CredentialDirectory(tmp_path).store_file.read_bytes() == before
    assert not list(tmp_path.glob(".*"))
