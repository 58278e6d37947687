"""The table of permissions."""

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
    services = {each.subject for each in permissions.SERVICES}
    assert not any(subject in (">", "$JS.API.>", "fleet.>") for subject in services)
    assert not any("STREAM" in subject or "CREATE" in subject or "DELETE" in subject for subject in services)
    assert len(services) == len(permissions.robot("r1").publish)


def test_operators_never_reach_the_robots_consumers() -> None:
    for commands in (False, True):
        allowed = permissions.operator(commands=commands)
        assert not any(f".{names.COMMANDS}." in subject for subject in allowed.publish)
        assert (names.COMMAND_SUBJECTS in allowed.publish) is commands
