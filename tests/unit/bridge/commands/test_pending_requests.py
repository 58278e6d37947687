"""How the hub's requests end that the gateway answers late, or never."""

import asyncio
from typing import Any

from bridge.commands.judgement import Request, Snapshot
from bridge.commands.pending_requests import ANSWER_WITHIN_S, PendingRequests
from omniseer.fleet.v1 import command_pb2 as pb
from tests.unit.bridge.commands.test_consumer import Outbox


class Robot:
    """Requests of one command that may be begun within 60 s, and a clock."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.outbox = Outbox()
        outbox: Any = self.outbox
        self.requests = PendingRequests("r1", outbox, lambda: None, lambda: self.now_s)
        action = Snapshot(pre_s=10, post_s=10, label="door")
        added = asyncio.run(self.requests.add(Request("c1", "anna", action, remaining_s=60.0)))
        assert added
        self.pending = added

    def expires(self) -> dict[str, int]:
        asyncio.run(self.requests.expire())
        return self.outbox.ended


def test_it_is_handed_over_until_the_end_of_its_time_only() -> None:
    robot = Robot()
    robot.now_s += 59
    assert list(robot.requests.pending) == [robot.pending]
    assert robot.requests.remaining_s(robot.pending) == 1
    robot.now_s += 1
    assert not list(robot.requests.pending)
    assert robot.requests.remaining_s(robot.pending) == 0


def test_one_that_was_begun_in_time_is_answered_by_what_became_of_it() -> None:
    """The defect: it had expired, and an operator who repeated it had two snapshots."""
    robot = Robot()
    robot.now_s += 60 + ANSWER_WITHIN_S - 1
    assert robot.expires() == {}
    asyncio.run(robot.requests.answer("c1", pb.COMMAND_OUTCOME_DONE, "made", "a recording"))
    assert robot.outbox.ended == {"c1": pb.COMMAND_OUTCOME_DONE}


def test_one_that_is_never_answered_expires_in_the_end() -> None:
    robot = Robot()
    robot.now_s += 60 + ANSWER_WITHIN_S
    assert robot.expires() == {"c1": pb.COMMAND_OUTCOME_EXPIRED}
