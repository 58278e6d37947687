"""What becomes of a message of the stream of commands, whatever it is."""

from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.commands.hub_time import HubTime, age_s, hub_time
from bridge.commands.judgement import Denial, Request, Snapshot, Stray, Upload, judge
from bridge.config import CommandSettings
from omniseer.fleet.v1 import command_pb2 as pb

BOTH = ("upload", "snapshot")
REFUSED, EXPIRED = pb.COMMAND_OUTCOME_REFUSED, pb.COMMAND_OUTCOME_EXPIRED


def command(**changes: Any) -> pb.Command:
    values = {
        "command_id": "c1",
        "robot": "lab2",
        "issued_by": "anna",
        "expires_after_s": 60,
        "upload": pb.UploadCommand(recording_id="2026-11-22T10-00-00-a1"),
        **changes,
    }
    return pb.Command(**{key: value for key, value in values.items() if value is not None})


def judged(message: pb.Command | bytes, **changes: Any) -> Any:
    payload = message if isinstance(message, bytes) else message.SerializeToString()
    options = {"robot": "lab2", "allowed": BOTH, "age_s": 1.0, **changes}
    subject = options.pop("subject", "fleet.lab2.cmd.c1")
    return judge(subject, payload, **options)


def test_what_is_allowed_and_in_time_is_handed_over() -> None:
    assert judged(command()) == Request("c1", "anna", Upload("2026-11-22T10-00-00-a1"), 59.0)
    snapshot = pb.SnapshotCommand(pre_s=20, label="door\x1b[2J")
    handed = judged(command(upload=None, snapshot=snapshot))
    assert isinstance(handed.action, Snapshot)
    assert (handed.action.pre_s, handed.action.post_s) == (20, None)
    assert "\x1b" not in handed.action.label


@pytest.mark.parametrize(
    ("message", "options"),
    [
        (command(robot="lab3"), {}),
        (command(command_id="c2"), {}),
        (command(expires_after_s=0), {}),
        (command(expires_after_s=86_401), {}),
        (command(upload=None), {}),
        (command(), {"allowed": ()}),
        (command(), {"allowed": ("snapshot",)}),
        (command(upload=pb.UploadCommand(recording_id="../../etc/passwd")), {}),
        (command(upload=pb.UploadCommand(recording_id="")), {}),
        (command(upload=None, snapshot=pb.SnapshotCommand(pre_s=3601)), {}),
        (command(upload=None, snapshot=pb.SnapshotCommand(post_s=601)), {}),
        (command(issued_by="x" * 5000), {}),
        (b"\xff\xff\xff", {}),
    ],
)
def test_what_is_not_is_refused(message: pb.Command | bytes, options: dict[str, Any]) -> None:
    denial = judged(message, **options)
    assert isinstance(denial, Denial)
    assert denial.outcome == REFUSED
    assert denial.message


@pytest.mark.parametrize("field", range(8, 16))
def test_an_action_of_another_schema_is_refused_with_a_sentence_of_ours(field: int) -> None:
    """Of reading the configuration, for example: what the hub wrote is not part of the answer."""
    wanted = b"bridge.yaml"
    payload = command(upload=None).SerializeToString() + bytes([field << 3 | 2, len(wanted)]) + wanted
    assert judged(payload) == Denial("c1", REFUSED, "there is no such command for robots")


def test_two_actions_are_all_that_there_are_and_results_have_no_room_for_more() -> None:
    """docs/fleet.md says what never crosses the wire: a further action or field is a decision."""
    (action,) = pb.Command.DESCRIPTOR.oneofs
    assert {field.name for field in action.fields} == set(BOTH)
    assert set(get_args(get_args(CommandSettings.model_fields["allowed"].annotation)[0])) == set(BOTH)
    result = pb.CommandResult.DESCRIPTOR.fields_by_name
    assert set(result) == {"command_id", "robot", "outcome", "message", "recording_id"}


@pytest.mark.parametrize("age", [None, 60.0, 1e9])
def test_what_is_late_or_may_be_is_expired(age: float | None) -> None:
    assert judged(command(), age_s=age).outcome == EXPIRED


@pytest.mark.parametrize(
    "subject", ["fleet.lab3.cmd.c1", "fleet.lab2.cmd.", "fleet.lab2.cmd.a.b", "fleet.lab2.ev.c1", "c1", ""]
)
def test_what_is_not_for_this_robot_has_no_answer(subject: str) -> None:
    assert isinstance(judged(command(), subject=subject), Stray)


@given(st.binary(max_size=5000), st.sampled_from(["fleet.lab2.cmd.c1", "x"]))
def test_whatever_comes_it_is_judged(payload: bytes, subject: str) -> None:
    judgement = judged(payload, subject=subject)
    assert isinstance(judgement, Request | Denial | Stray)


def test_age_is_by_the_hubs_clock_and_the_robots_steps_change_nothing() -> None:
    hub = hub_time({"ts": "2026-11-22T10:00:00.123456789Z"}, asked_s=100.0)
    assert hub
    for step_s in (-3600.0, 0.0, 3600.0):
        age = age_s(hub.unix_s - 5, 107.0, hub, hub.unix_s + step_s)
        assert age == pytest.approx(12.0)


def test_without_the_hubs_clock_a_synchronised_one_counts_or_none() -> None:
    assert age_s(1000.0, 5.0, None, 1010.0) == 10.0
    assert age_s(1000.0, 5.0, None, None) is None
    assert age_s(1000.0, 5.0, None, 990.0) is None, "from the future: the clocks can't be compared"
    assert age_s(1000.0, 5.0, HubTime(990.0, 5.0), None) is None
    assert age_s(1000.0, 5.0, HubTime(999.0, 5.0), None) == 0.0


@pytest.mark.parametrize("info", [None, {}, [], {"ts": 3}, {"ts": "yesterday"}, {"ts": "9999-99-99"}])
def test_a_hub_that_does_not_say_the_time(info: Any) -> None:
    assert hub_time(info, 1.0) is None
