"""The table of permissions."""

from typing import get_args

import pytest

from fleet import names
from hub import permissions


def test_a_robot_has_no_subject_of_another() -> None:
    allowed = permissions.robot("r1")
    assert allowed.publish
    for subject in allowed.publish:
        assert ".r1" in subject
    assert allowed.subscribe == (f"{names.inbox_prefix('r1')}.>",)
    # Commands are for operators.
    assert not any(".cmd" in subject for subject in (*allowed.publish, *allowed.subscribe))


def test_a_robot_can_reach_what_it_may_publish_to_and_nothing_more() -> None:
    services = _services("robots")
    assert not any("STREAM" in subject for subject in services)
    assert len(services) == len(permissions.robot("r1").publish)


@pytest.mark.parametrize("account", permissions.IMPORTS)
def test_no_account_reaches_what_changes_streams_or_makes_consumers(account: permissions.AccountName) -> None:
    """Permissions don't bound where the servers send answers, nor where consumers deliver."""
    services = _services(account)
    assert not any(subject in (">", "$JS.API.>", "fleet.>") for subject in services)
    changing = ("CREATE", "DELETE", "UPDATE", "PURGE", "RESTORE", "SNAPSHOT", "LEADER")
    assert not any(word in subject for subject in services for word in changing)


@pytest.mark.parametrize("commands", [False, True])
def test_people_can_reach_what_they_may_publish_to_and_nothing_more(*, commands: bool) -> None:
    allowed = permissions.operator(commands=commands)
    account: permissions.AccountName = "commanders" if commands else "people"
    reachable = {each.local or each.subject for row in permissions.IMPORTS[account].values() for each in row}
    assert set(allowed.publish) == reachable
    assert not any(names.COMMANDS in subject for subject in reachable)
    assert (names.COMMAND_SUBJECTS in reachable) is commands


def test_receivers_list_recordings_and_answer() -> None:
    allowed = permissions.receiver()
    assert set(allowed.publish) == _services("receivers")
    taken = {each.partition(" ")[0] for each in allowed.subscribe} - {"_INBOX.>"}
    users = permissions.IMPORTS.keys() - {"system"}
    exported = {each.subject for user in users for each in permissions.IMPORTS[user].get("receivers", ())}
    assert taken == exported


def test_the_system_account_imports_from_all_others_what_no_user_may_serve_or_request() -> None:
    """Servers load all accounts with it."""
    row = permissions.IMPORTS["system"]
    assert {"system", *row} == set(get_args(permissions.AccountName))
    assert all(each.subject.startswith("hub.loaded.") for services in row.values() for each in services)
    for allowed in (permissions.robot("r1"), permissions.operator(commands=True), permissions.receiver()):
        assert not any(each.startswith(("hub.", ">")) for each in (*allowed.publish, *allowed.subscribe))


def _services(account: permissions.AccountName) -> set[str]:
    return {each.subject for row in permissions.IMPORTS[account].values() for each in row}
