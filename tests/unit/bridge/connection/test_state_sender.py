"""When the robot's state is sent, on a clock that moves only while the sender rests."""

from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from bridge.connection import state_sender
from bridge.connection.state_sender import StateSender
from bridge.connection.uploading import NoUploads
from bridge.outbox.database import Facts
from fleet.errors import UnreachableError
from fleet.names import STATES
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1.system_status_pb2 import SystemStatus


class EndError(Exception):
    """The time of the test has passed."""


class World:
    """Clock, gateway and hub of one sender.

    Args:
        mode: of the robot at an instant.

    Attributes:
        now_s: since the start; moved by sleeping.
        end_s: when the test ends.
        refusals: how many states the hub refuses first.
        away_s: how long the first connection takes.
        takes_s: how long the hub takes for a state.
        pauses: that would have ended with another connection.
        sent: states that the hub took, and when.
    """

    reachable = True
    facts = Facts()

    def __init__(self, mode: Callable[[float], str]) -> None:
        self._mode = mode
        self._looks = 0
        self.now_s = 0.0
        self.end_s = 0.0
        self.refusals = 0
        self.away_s = 0.0
        self.takes_s = 0.0
        self.pauses = 0
        self.sent: list[tuple[float, RobotState]] = []

    @property
    def newest(self) -> SystemStatus:
        status = SystemStatus()
        status.mission.available = True
        status.mission.mode = self._mode(self.now_s)
        return status

    @property
    def times(self) -> list[float]:
        """When states were sent."""
        return [at_s for at_s, _ in self.sent]

    @property
    def modes(self) -> list[str]:
        return [state.mode for _, state in self.sent]

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        if self.now_s > self.end_s:
            raise EndError

    async def pause(self, longest_s: float) -> None:
        self.pauses += 1
        await self.sleep(longest_s)

    async def connected(self) -> None:
        self._looks += 1
        assert self._looks < 10_000, "it never rests"
        away_s, self.away_s = self.away_s, 0.0
        self.now_s += away_s

    async def put(self, bucket: str, key: str, value: bytes) -> None:
        assert (bucket, key) == (STATES, "lab2")
        if self.refusals:
            self.refusals -= 1
            raise UnreachableError("the hub is away")
        self.sent.append((self.now_s, RobotState.FromString(value)))
        self.now_s += self.takes_s

    async def run(self, seconds: float) -> StateSender:
        """Runs a sender for so long."""
        self.end_s = seconds
        others: dict[str, Any] = {"status": self, "outbox": self, "uploads": NoUploads(), "hub": self}
        sender = StateSender("lab2", "", "run-1", **others)
        with pytest.raises(EndError):
            await sender.run()
        return sender


Made = Callable[[Callable[[float], str]], World]


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Made:
    def made(mode: Callable[[float], str]) -> World:
        world = World(mode)
        clock = SimpleNamespace(monotonic=lambda: world.now_s, time_ns=lambda: round(world.now_s * 1e9))
        monkeypatch.setattr(state_sender, "time", clock)
        monkeypatch.setattr(state_sender, "asyncio", SimpleNamespace(sleep=world.sleep))
        return world

    return made


@pytest.mark.parametrize("takes_s", [0.0, 0.25])
async def test_a_thousand_changes_a_second_are_one_state_a_second_and_the_newest(
    world: Made, takes_s: float
) -> None:
    """Also where it has changed before the hub has taken it."""
    busy = world(lambda s: f"mode {s * 1000:.0f}")
    busy.takes_s = takes_s
    sender = await busy.run(10)
    expected = [number * (1 + takes_s) for number in range(9)]
    assert busy.times[:9] == expected
    assert busy.modes[:9] == [f"mode {at_s * 1000:.0f}" for at_s in expected]
    assert sender.sent == len(busy.sent) == (9 if takes_s else 11)


async def test_a_robot_at_rest_is_heard_every_ten_seconds(world: Made) -> None:
    resting = world(lambda _: "idle")
    await resting.run(60)
    assert resting.times == [0, 10, 20, 30, 40, 50, 60]


async def test_a_change_at_rest_is_sent_within_a_second(world: Made) -> None:
    changing = world(lambda s: "idle" if s < 12.5 else "drive")
    await changing.run(30)
    assert changing.times == [0, 10, 13, 23]
    assert changing.modes == ["idle", "idle", "drive", "drive"]


async def test_what_changed_while_the_hub_was_away_is_one_state(world: Made) -> None:
    away = world(lambda s: f"mode {s:.0f}")
    away.away_s = 3600
    away.refusals = 3
    sender = await away.run(3620)
    assert sender.sent == len(away.sent)
    assert away.pauses == 3
    assert [state.sequence for _, state in away.sent] == list(range(1, len(away.sent) + 1))
    assert away.times[0] >= 3600
    present = [f"mode {at_s:.0f}" for at_s in away.times]
    assert away.modes == present, "not the one that was refused"
    assert all(later - before >= 1 for before, later in pairwise(away.times))
