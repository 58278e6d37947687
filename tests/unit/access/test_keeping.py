"""What a robot's keeper does: nothing is lost between two who do it at once; a rotated secret takes over."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.access.credential import Kind, State
from gateway.access.directory import CredentialDirectory
from gateway.access.keeping import Keeper, Wanted
from gateway.access.role import Role
from gateway.access.store import Store

NOW_S = 1_000_000.0


@pytest.fixture
def keeper(tmp_path: Path) -> Keeper:
    keeper = Keeper(CredentialDirectory(tmp_path), "lab", lambda: NOW_S)
    keeper.begin(("localhost",))
    return keeper


def states(path: Path) -> list[tuple[str, str]]:
    """Names and states, oldest first."""
    kept = CredentialDirectory(path).read_store().credentials.values()
    return [(each.name, each.state(NOW_S).value) for each in kept]


def test_changes_at_once_are_all_kept(keeper: Keeper, tmp_path: Path) -> None:
    names = [f"person-{number}" for number in range(40)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda name: keeper.add(Wanted(name, Role.VIEWER)), names))
    assert sorted(name for name, _ in states(tmp_path)) == sorted(names)


def test_a_rotated_token_replaces_the_old_one_at_once_or_later(keeper: Keeper, tmp_path: Path) -> None:
    keeper.add(Wanted("anna", Role.OPERATOR))
    new, bundle = keeper.rotate("anna")
    assert (new.name, new.role) == ("anna", Role.OPERATOR)
    assert bundle.token
    assert states(tmp_path) == [("anna", "revoked"), ("anna", "valid")]
    keeper.rotate(new.credential_id, overlap_s=60)
    assert states(tmp_path) == [("anna", "revoked"), ("anna", "valid"), ("anna", "valid")]
    kept = CredentialDirectory(tmp_path).read_store().credentials[new.credential_id]
    assert kept.state(NOW_S + 60) is State.EXPIRED


def test_who_has_two_is_asked_which(keeper: Keeper) -> None:
    first, _ = keeper.add(Wanted("anna", Role.VIEWER))
    second, _ = keeper.add(Wanted("anna", Role.ADMIN))
    with pytest.raises(UserError, match=f"{first.credential_id}, {second.credential_id}"):
        keeper.rotate("anna")
    assert {each.credential_id for each in keeper.revoke("anna")} == {
        first.credential_id,
        second.credential_id,
    }


def test_a_rotation_lasts_as_long_as_what_it_replaces(keeper: Keeper) -> None:
    keeper.add(Wanted("anna", Role.VIEWER, days=7))
    assert keeper.rotate("anna")[0].ends_s == NOW_S + 7 * 86_400


def test_a_bundle_holds_what_the_list_does_not(keeper: Keeper, tmp_path: Path) -> None:
    _, token = keeper.add(Wanted("anna", Role.VIEWER))
    _, certificate = keeper.add(Wanted("ben", Role.VIEWER, Kind.CERTIFICATE))
    listed = CredentialDirectory(tmp_path).store_file.read_text()
    assert token.token in token.text()
    assert token.token.partition(".")[2] not in listed
    assert "PRIVATE KEY" in certificate.text()
    assert "PRIVATE KEY" not in listed
    assert token.token not in repr(token)


def test_a_change_that_fails_changes_nothing(keeper: Keeper, tmp_path: Path) -> None:
    keeper.add(Wanted("anna", Role.VIEWER))
    before = CredentialDirectory(tmp_path).store_file.read_bytes()

    def fail(_store: Store) -> Store:
        raise UserError("no")

    with pytest.raises(UserError, match="no"):
        CredentialDirectory(tmp_path).change_store(fail)
    assert CredentialDirectory(tmp_path).store_file.read_bytes() == before
    assert not list(tmp_path.glob(".*"))
