"""Reloading: changes take effect, and files that can't be read leave the last good version in effect."""

import asyncio
import re
import threading
import time
from contextlib import suppress
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.access import reloader
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import (
    FAILURES_REPORTED,
    POLL_INTERVAL_S,
    CredentialReloader,
    LoadedAccess,
    TlsFiles,
    load_access,
)
from gateway.access.role import Role
from gateway.config import SecuritySettings
from gateway.rpc.connections.refusal_delay import REFUSAL_DELAY_S


@pytest.fixture
def directory(tmp_path: Path) -> CredentialDirectory:
    directory = CredentialDirectory(tmp_path / "credentials")
    CredentialAdmin(directory, "lab").initialize(("localhost",))
    return directory


def tls_of(directory: CredentialDirectory) -> TlsFiles:
    return TlsFiles(
        directory.server.certificate,
        directory.server.key,
        directory.ca.certificate,
        directory.ca.certificate,
    )


async def test_a_new_credential_is_loaded_at_once_and_reported_once(directory: CredentialDirectory) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, None, changes.append)
    credential, _ = CredentialAdmin(directory, "lab").add(CredentialRequest("anna", Role.VIEWER))
    await asyncio.gather(*(reloader.reload_for_unknown() for _ in range(20)))
    await reloader.reload_for_unknown()
    assert [set(each.store.credentials) for each in changes] == [{credential.credential_id}]
    assert reloader.loaded is changes[0]


async def test_on_a_disk_that_hangs_unknown_credentials_share_one_poll(
    directory: CredentialDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: each of them left a task behind that waited for the disk, without a limit."""
    answers, hangs, signature = threading.Event(), threading.Event(), reloader._signature

    def slow_signature(path: Path) -> tuple[int, ...]:
        hangs.set()
        answers.wait(30)
        return signature(path)

    changes: list[LoadedAccess] = []
    reloading = CredentialReloader(directory, None, changes.append)
    monkeypatch.setattr(reloader, "UNKNOWN_WITHIN_S", 0.02)
    monkeypatch.setattr(reloader, "_signature", slow_signature)
    try:
        await reloading.reload_for_unknown()
        assert await asyncio.to_thread(hangs.wait, 5)
        for _ in range(10):
            await reloading.reload_for_unknown()
        polls = [each for each in asyncio.all_tasks() if each.get_name() == "reload for unknown credential"]
        assert len(polls) == 2, "one hangs, and one begins after it"
        credential, _ = CredentialAdmin(directory, "lab").add(CredentialRequest("anna", Role.VIEWER))
    finally:
        answers.set()
    await asyncio.wait_for(asyncio.gather(*polls), 5)
    assert [set(each.store.credentials) for each in changes] == [{credential.credential_id}]


async def test_a_damaged_file_changes_nothing_and_is_reported_when_it_stays(
    directory: CredentialDirectory, caplog: pytest.LogCaptureFixture
) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    before, text = reloader.loaded, directory.store_file.read_text()
    directory.store_file.write_text("damaged")
    problems = []
    for _ in range(FAILURES_REPORTED + 1):
        await reloader.reload_for_unknown()
        problems.append(reloader.view().unread)
    *unreported, reported, last = problems
    assert set(unreported) == {None}
    assert reported == last
    assert reported
    assert "is damaged" in reported.why
    assert "credentials init --again" in reported.remedy
    assert reported.is_list
    assert f"{reported.why}. {reported.remedy}" in caplog.text
    assert len(caplog.records) == 1
    directory.store_file.write_text(text)
    await reloader.reload_for_unknown()
    assert reloader.view().unread is None
    assert (reloader.loaded, changes) == (before, [])


def test_a_refused_caller_learns_of_a_revocation_within_a_second() -> None:
    """What is promised, with a quarter of a second for a busy robot."""
    assert POLL_INTERVAL_S + REFUSAL_DELAY_S <= 0.75


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
    for _ in range(FAILURES_REPORTED):
        await reloader.reload_for_unknown()
    (change,) = changes
    assert change.store.credentials[credential.credential_id].revoked_s is not None
    unread = reloader.view().unread
    assert unread
    assert "certificate" in unread.why
    assert not unread.is_list


def test_the_end_of_each_certificate_is_loaded(directory: CredentialDirectory) -> None:
    loaded = load_access(directory, tls_of(directory))
    assert set(loaded.ends_s) == {"server_certificate", "authority"}
    assert loaded.ends_s["server_certificate"] < loaded.ends_s["authority"]


def test_a_key_of_another_certificate_is_refused(directory: CredentialDirectory) -> None:
    tls = TlsFiles(directory.server.certificate, directory.ca.key)
    with pytest.raises(UserError, match="is not the key of"):
        load_access(directory, tls)


class Crash(BaseException):
    """The end of a program that can do nothing more, as a power loss is."""


def rotate_ca_until_it_has_replaced(
    files: int, directory: CredentialDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, replaced = Path.replace, count()

    def replace_or_crash(path: Path, target: Path) -> Path:
        if next(replaced) == files:
            raise Crash
        return replace(path, target)

    with monkeypatch.context() as patched, suppress(Crash):
        patched.setattr(Path, "replace", replace_or_crash)
        CredentialAdmin(directory, "lab").rotate_ca(None)


def problem_of(directory: CredentialDirectory) -> str:
    """What a start says; empty if the gateway starts."""
    access_files = SecuritySettings(credentials=directory.path).access_files()
    assert access_files
    try:
        load_access(*access_files)
    except UserError as error:
        return f"{error.what}. {error.remedy}"
    return ""


@pytest.mark.parametrize(
    ("replaced", "problem"),
    [
        (0, ""),
        (1, "is not the key of"),
        (2, "was not issued by the certificate authority"),
        (3, "was not issued by the certificate authority"),
        # The new CA is complete: only the list does not say yet what it has ended.
        (4, ""),
        (5, ""),
    ],
)
def test_half_a_rotation_of_the_ca_is_said_and_mended_by_what_is_proposed(
    directory: CredentialDirectory, monkeypatch: pytest.MonkeyPatch, replaced: int, problem: str
) -> None:
    rotate_ca_until_it_has_replaced(replaced, directory, monkeypatch)
    found = problem_of(directory)
    assert problem in found
    assert bool(found) == bool(problem)
    admin = CredentialAdmin(directory, "lab")
    commands = {"server": admin.rotate_server, "ca": admin.rotate_ca}
    typed = []
    while match := re.search(r"[Tt]ype: robot-gateway credentials rotate (\w+)", found):
        typed.append(match[1])
        assert len(typed) <= 2, "each command mends something"
        try:
            commands[match[1]](None)
        except UserError as error:
            found = f"{error.what}. {error.remedy}"
        else:
            found = problem_of(directory)
    assert found == ""


async def test_half_a_rotation_changes_nothing_in_a_gateway_that_runs(
    directory: CredentialDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes: list[LoadedAccess] = []
    reloader = CredentialReloader(directory, tls_of(directory), changes.append)
    before = reloader.loaded
    rotate_ca_until_it_has_replaced(2, directory, monkeypatch)
    for _ in range(FAILURES_REPORTED):
        await reloader.reload_for_unknown()
    assert (reloader.loaded, changes) == (before, [])
    unread = reloader.view().unread
    assert unread
    assert "was not issued by" in unread.why
    assert "credentials rotate server" in unread.remedy
    assert not unread.is_list
    # What completes it may leave the gateway's files as they are.
    CredentialAdmin(directory, "lab").rotate_ca(None)
    await reloader.reload_for_unknown()
    assert len(changes) == 1
    assert reloader.view().unread is None


def test_a_certificate_of_another_authority_needs_none_of_the_robots(
    directory: CredentialDirectory, tmp_path: Path
) -> None:
    bought = CredentialDirectory(tmp_path / "bought")
    CredentialAdmin(bought, "elsewhere").initialize(("localhost",))
    tls = {"certificate": bought.server.certificate, "key": bought.server.key}
    access_files = SecuritySettings.model_validate({"credentials": directory.path, "tls": tls}).access_files()
    assert access_files
    assert load_access(*access_files).tls


@pytest.mark.parametrize("of_clients", [True, False])
def test_a_damaged_authority_is_to_be_restored_or_replaced(
    directory: CredentialDirectory, of_clients: bool
) -> None:
    authority = directory.ca.certificate
    authority.write_text("damaged")
    tls = (
        replace(tls_of(directory), issuer=None) if of_clients else replace(tls_of(directory), client_ca=None)
    )
    with pytest.raises(UserError, match=f"authority {authority} can't be parsed") as caught:
        load_access(directory, tls)
    assert caught.value.remedy == (
        "Restore a copy, or make a new authority, whose certificate every laptop then needs: "
        f"robot-gateway credentials rotate ca --directory {directory.path}"
    )


def test_a_damaged_authority_of_others_is_not_to_be_made_anew(
    directory: CredentialDirectory, tmp_path: Path
) -> None:
    bought = tmp_path / "bought.pem"
    bought.write_text("damaged")
    with pytest.raises(UserError, match="can't be parsed") as caught:
        load_access(directory, replace(tls_of(directory), client_ca=bought))
    assert caught.value.remedy == "Replace it by a PEM file"
