"""Reloading: changes take effect, and files that can't be read leave the last good version in effect."""

import asyncio
import time
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import CredentialReloader, LoadedAccess, TlsFiles, load_access
from gateway.access.role import Role


@pytest.fixture
def directory(tmp_path: Path) -> CredentialDirectory:
    directory = CredentialDirectory(tmp_path / "credentials")
    CredentialAdmin(directory, "lab").initialize(("localhost",))
    return directory


def tls_of(directory: CredentialDirectory) -> TlsFiles:
    return TlsFiles(directory.server.certificate, directory.server.key, directory.ca.certificate)


async def test_a_new_credential_is_loaded_at_once_and_reported_once(directory: CredentialDirectory) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, None, changes.append)
    credential, _ = CredentialAdmin(directory, "lab").add(CredentialRequest("anna", Role.VIEWER))
    await asyncio.gather(*(reloader.reload_for_unknown() for _ in range(20)))
    await reloader.reload_for_unknown()
    assert [set(each.store.credentials) for each in changes] == [{credential.credential_id}]
    assert reloader.loaded is changes[0]


async def test_a_damaged_file_changes_nothing_and_is_reported_after_three_polls(
    directory: CredentialDirectory,
) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    before, text = reloader.loaded, directory.store_file.read_text()
    directory.store_file.write_text("damaged")
    problems = []
    for _ in range(3):
        await reloader.reload_for_unknown()
        problems.append(reloader.view().credentials_error)
    assert problems[:2] == ["", ""]
    assert "is damaged" in problems[2]
    directory.store_file.write_text(text)
    await reloader.reload_for_unknown()
    assert reloader.view().credentials_error == ""
    assert (reloader.loaded, changes) == (before, [])


async def test_a_list_that_stays_unreadable_is_out_of_effect_until_it_is_readable(
    directory: CredentialDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes: list[LoadedAccess] = []
    monkeypatch.setattr("gateway.access.reloader.CLOSED_AFTER_S", 0.25)
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    before = reloader.loaded
    hidden = directory.store_file.rename(directory.path / "elsewhere")
    began_s = time.monotonic()
    await reloader.reload_for_unknown()
    assert (changes, reloader.view().closed) == ([], False)
    while not changes:
        await reloader.reload_for_unknown()
    assert time.monotonic() - began_s >= 0.25
    await reloader.reload_for_unknown()
    assert reloader.view().closed
    (closed,) = changes
    assert "can't be read" in closed.problem
    hidden.rename(directory.store_file)
    await reloader.reload_for_unknown()
    assert (changes, reloader.view().closed) == ([closed, before], False)


async def test_a_revocation_does_not_wait_for_a_certificate(directory: CredentialDirectory) -> None:
    changes: list[LoadedAccess] = []
    admin = CredentialAdmin(directory, "lab")
    credential, _ = admin.add(CredentialRequest("anna", Role.VIEWER))
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    directory.server.certificate.write_text("damaged")
    admin.revoke("anna")
    for _ in range(3):
        await reloader.reload_for_unknown()
    (change,) = changes
    assert change.store.credentials[credential.credential_id].revoked_s is not None
    assert "certificate" in reloader.view().credentials_error


def test_the_end_of_each_certificate_is_loaded(directory: CredentialDirectory) -> None:
    loaded = load_access(directory, tls_of(directory))
    assert set(loaded.ends_s) == {"server_certificate", "authority"}
    assert loaded.ends_s["server_certificate"] < loaded.ends_s["authority"]


def test_a_key_of_another_certificate_is_refused(directory: CredentialDirectory) -> None:
    tls = TlsFiles(directory.server.certificate, directory.ca.key)
    with pytest.raises(UserError, match="is not the key of"):
        load_access(directory, tls)
