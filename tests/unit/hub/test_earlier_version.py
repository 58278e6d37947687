"""People of a hub of an earlier version are named, whatever interrupts that they are moved."""

from pathlib import Path

import pytest

from common.errors import UserError
from hub import administration
from hub.accounts import add_accounts
from hub.creation import HubPlan, create
from hub.directory import ACCOUNTS_OF_PEOPLE, HubDirectory, User
from hub.server_config import Node, Places

_USERS = (
    User("r1", "robot", ("key of r1",)),
    User("left", "operator", ("key of left",), revoked=5),
    User("anna", "operator", ("first key of anna", "second key of anna")),
    User("receiver", "receiver", ("key of receiver",)),
)


class _InterruptedError(Exception):
    """Ends a program in the middle."""


@pytest.fixture
def hub(tmp_path: Path) -> HubDirectory:
    """Such a hub's directory; of the people one has been revoked."""
    directory = HubDirectory(tmp_path / "hub")
    create(directory, HubPlan("lab", (Node("n1", "localhost"),), Places(), "1GB", sync_always=True))
    record = directory.read()
    for user in _USERS:
        record = record.with_user(user)
    directory.write(record)
    for name in ACCOUNTS_OF_PEOPLE:
        (directory.path / "keys" / f"{name}.nk").unlink()
    return directory


def _named(hub: HubDirectory) -> list[str]:
    users: list[User] = []
    administration.move_people(hub, users.append)
    return [each.name for each in users]


def _check(hub: HubDirectory) -> None:
    """Checks that all is done, and said once."""
    assert hub.missing_accounts() == ()
    record = hub.read()
    assert [each.name for each in record.users if each.revoked is None] == ["r1"]
    assert set(record.revoked) == {"first key of anna", "second key of anna", "key of receiver"}
    assert _named(hub) == []


def test_people_and_receivers_are_named_once(hub: HubDirectory) -> None:
    assert _named(hub) == ["anna", "receiver"]
    _check(hub)


def test_they_are_named_after_their_accounts_could_not_be_made(
    hub: HubDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: their credentials had ended, and nothing ever said whose."""

    def full(_directory: HubDirectory) -> None:
        raise UserError("the disk is full", "Free some space")

    with monkeypatch.context() as patched:
        patched.setattr(administration, "add_accounts", full)
        with pytest.raises(UserError, match="the disk is full"):
            _named(hub)
    assert _named(hub) == ["anna", "receiver"]
    _check(hub)


def test_they_are_named_after_it_ended_when_their_accounts_were_made(
    hub: HubDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    def end(directory: HubDirectory) -> None:
        add_accounts(directory)
        raise _InterruptedError

    with monkeypatch.context() as patched:
        patched.setattr(administration, "add_accounts", end)
        with pytest.raises(_InterruptedError):
            _named(hub)
    assert _named(hub) == ["anna", "receiver"]
    _check(hub)


def test_they_are_named_again_where_that_was_interrupted(hub: HubDirectory) -> None:
    def end(_user: User) -> None:
        raise _InterruptedError

    with pytest.raises(_InterruptedError):
        administration.move_people(hub, end)
    assert _named(hub) == ["anna", "receiver"]
    _check(hub)
