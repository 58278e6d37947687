"""What a driver's session sends: when a hold lapses, and when another one begins."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from itertools import count

import pytest

from console.client.blocking import BlockingDriveSession
from console.client.drive_commands import HOLD_COUNTS_S
from console.client.drive_lanes import LANES, MAX_UNACKNOWLEDGED, LaneItem
from console.client.drive_session import COMMANDS_PER_S, DriveOptions, DriveSession
from console.client.errors import Cancelled, Overloaded, Refused, Unreachable
from console.client.loop_thread import LoopThread
from console.client.mapping.methods import Method
from console.client.results import DriveOpened, DrivePhase, DriveState
from omniseer.gateway.v1 import teleop_pb2
from tests.support.eventually import eventually
from tests.unit.console.client.results.test_driving import LIMITS

SPEED_MPS = 0.125
PATIENT_S = 60.0


def have_holds_count_for(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    monkeypatch.setattr("console.client.drive_commands.HOLD_COUNTS_S", seconds)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine this process may stand still for longer than a hold counts."""
    have_holds_count_for(monkeypatch, PATIENT_S)


class Robot:
    """Opens lanes, keeps what comes on them, and acknowledges it as long as it `answers`."""

    def __init__(self) -> None:
        self.answers = True
        self.takes = asyncio.Event()
        """Set while the lanes take what is written on them."""
        self.takes.set()
        self.ends_with: Refused | None = None
        self.opens_with: Refused | None = None
        self.max_lanes = LANES
        self.refused = 0
        self.lanes: list[PlayedLane] = []
        self.commands: list[teleop_pb2.DriveCommand] = []
        """Each once, in order: the first copy counts."""
        self.finished = 0
        self._monotonic_ns = count(10**9, 10**6)

    def connect(self) -> "PlayedTransport":
        return PlayedTransport(self)

    def take(self, request: bytes) -> None:
        message = teleop_pb2.DriveRequest.FromString(request)
        if message.HasField("command") and message.command.sequence > self.newest:
            self.commands.append(message.command)

    @property
    def newest(self) -> int:
        return self.commands[-1].sequence if self.commands else 0

    @property
    def held(self) -> bool:
        return bool(self.commands) and self.commands[-1].held

    def state(self) -> DriveState:
        return DriveState(
            monotonic_ns=next(self._monotonic_ns),
            newest_sequence=self.newest,
            phase=DrivePhase.ARMED,
            inhibits=(),
            vx_mps=0.0,
            vy_mps=0.0,
            wz_rad_s=0.0,
            command_age_ms=0,
            loop_age_ms=0,
            picture_age_ms=None,
            speed_limit_mps=0.0,
            stop=None,
            problems=(),
            turn_limit_rad_s=0.0,
        )


class PlayedLane:
    def __init__(self, robot: Robot) -> None:
        self._robot, self._opened = robot, False
        self.lost = self.silent = self.writing = False
        self.written = 0
        self._finished = asyncio.Event()

    async def write(self, request: bytes) -> None:
        self.writing = True
        await self._robot.takes.wait()
        self.writing = False
        self.written += 1
        self._robot.take(request)

    async def read(self) -> LaneItem:
        if not self._opened:
            if self._robot.opens_with:
                self._robot.refused += 1
                raise self._robot.opens_with
            self._opened = True
            return DriveOpened(
                session_id="a session", run_id="a run", limits=LIMITS, max_lanes=self._robot.max_lanes
            )
        while True:
            if self._robot.ends_with:
                raise self._robot.ends_with
            if self._finished.is_set() or self.lost:
                raise Unreachable("the lane has ended")
            await asyncio.sleep(1 / COMMANDS_PER_S)
            if self._robot.answers and not self.silent:
                return self._robot.state()

    async def finish(self) -> None:
        self._robot.finished += 1
        self._finished.set()

    def cancel(self) -> None:
        self._finished.set()


class PlayedTransport:
    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def open_both_ways(self, method: Method[LaneItem]) -> PlayedLane:  # noqa: ARG002  # there is one
        lane = PlayedLane(self._robot)
        self._robot.lanes.append(lane)
        return lane

    async def close(self) -> None:
        pass


@asynccontextmanager
async def driving(robot: Robot) -> AsyncIterator[DriveSession]:
    async with DriveSession(robot.connect, DriveOptions(), opens_within_s=5.0) as session:
        await session.ready(within_s=5.0)
        yield session


async def until(condition: Callable[[], object], what: str) -> None:
    async def ask() -> object:
        return condition()

    await eventually(ask, bool, what)


async def more_commands(robot: Robot, number: int, each: Callable[[], None] = lambda: None) -> list[bool]:
    """Calls `each` until the robot has so many more commands; returns which of them held."""
    before = len(robot.commands)

    def enough() -> bool:
        each()
        return len(robot.commands) >= before + number

    await until(enough, f"{number} commands")
    return [command.held for command in robot.commands[before:]]


async def test_a_hold_that_is_renewed_goes_on_and_a_release_ends_it() -> None:
    robot = Robot()
    async with driving(robot) as session:
        holds = await more_commands(robot, 20, partial(session.hold, SPEED_MPS))
        assert holds[-10:] == [True] * 10
        assert robot.commands[-1].vx_mps == SPEED_MPS
        session.release()
        await until(lambda: not robot.held, "the release")
        assert not any(await more_commands(robot, 5))
        assert robot.commands[-1].vx_mps == 0.0
        assert not session.lapsed


async def test_a_hold_that_is_not_renewed_lapses_and_no_other_counts_until_a_release(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = Robot()
    async with driving(robot) as session:
        session.hold(SPEED_MPS)
        await until(lambda: robot.held, "the hold")
        have_holds_count_for(monkeypatch, HOLD_COUNTS_S)
        await until(lambda: not robot.held, "it has lapsed")
        session.hold(SPEED_MPS)
        await until(lambda: session.lapsed, "it says so")
        assert "release, then hold again" in session.reasons()
        have_holds_count_for(monkeypatch, PATIENT_S)
        assert not any(await more_commands(robot, 10, partial(session.hold, SPEED_MPS)))
        session.release()
        assert not session.lapsed
        holds = await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        assert holds[-5:] == [True] * 5


async def test_a_hold_that_comes_too_late_does_not_go_on_although_no_command_was_due_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = Robot()
    async with driving(robot) as session:
        session.hold(SPEED_MPS)
        await until(lambda: robot.held, "the hold")
        have_holds_count_for(monkeypatch, 0.0)
        session.hold(SPEED_MPS)
        have_holds_count_for(monkeypatch, PATIENT_S)
        assert session.lapsed
        assert not any(await more_commands(robot, 10, partial(session.hold, SPEED_MPS)))


async def test_a_release_and_a_hold_at_once_are_two_holds() -> None:
    """Without a command in between that is no hold, the robot would see one that goes on."""
    robot = Robot()
    async with driving(robot) as session:
        await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        session.release()
        holds = await more_commands(robot, 10, partial(session.hold, -SPEED_MPS))
        assert not holds[0]
        assert holds[-5:] == [True] * 5


def held_for(session: DriveSession, commands: int) -> Callable[[], bool]:
    """A condition: that the driver has held while so many more commands were made, written or not."""
    until_sequence = session._commands.sequence + commands

    def enough() -> bool:
        session.hold(SPEED_MPS)
        return session._commands.sequence > until_sequence

    return enough


async def test_no_hold_begins_before_the_release_has_left() -> None:
    robot = Robot()
    async with driving(robot) as session:
        await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        robot.takes.clear()
        await until(lambda: all(lane.writing for lane in robot.lanes), "each lane is at a write")
        stuck = len(robot.commands)
        session.release()
        await until(held_for(session, 5), "held again, for some commands")
        assert len(robot.commands) == stuck, "nothing has left since the release"
        robot.takes.set()
        holds = await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        released = holds.index(False)
        assert released <= LANES, "what was being written, then the release"
        assert holds[-3:] == [True] * 3


async def test_a_release_passes_lanes_that_are_full_and_the_next_hold_waits() -> None:
    """As where only the states are held up: the robot has all commands, and would go on by the last one."""
    robot = Robot()
    async with driving(robot) as session:
        await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        robot.answers = False
        await until(held_for(session, 2 * MAX_UNACKNOWLEDGED), "the lanes are full")
        full, written = len(robot.commands), [lane.written for lane in robot.lanes]
        await until(held_for(session, 5), "they are")
        assert len(robot.commands) == full
        session.release()
        await until(lambda: len(robot.commands) > full, "the release")
        await until(held_for(session, 5), "held again, for some commands")
        assert not any(command.held for command in robot.commands[full:])
        assert [lane.written for lane in robot.lanes] == [each + 1 for each in written]
        robot.answers = True
        holds = await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        assert holds[-3:] == [True] * 3


async def test_the_last_command_is_a_release_on_every_lane() -> None:
    robot = Robot()

    async def fail() -> None:
        async with driving(robot) as session:
            await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()
    assert not robot.held
    assert robot.finished == LANES


async def test_what_ends_the_session_ends_the_hold() -> None:
    robot = Robot()
    async with driving(robot) as session:
        await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        session.check()
        robot.ends_with = Refused("taken over")
        await until(lambda: session.error, "it has ended")
        assert session.error is robot.ends_with
        assert not session._commands.held
        with pytest.raises(Refused, match="taken over"):
            session.check()


async def test_a_lane_whose_states_are_held_up_goes_on_sending() -> None:
    """The other one says what has arrived, and may be the one whose commands are held up."""
    robot = Robot()
    async with driving(robot) as session:
        lane = robot.lanes[-1]
        lane.silent, before = True, lane.written
        await more_commands(robot, 4 * MAX_UNACKNOWLEDGED, partial(session.hold, SPEED_MPS))
        assert lane.written - before > 3 * MAX_UNACKNOWLEDGED


async def test_a_lane_that_an_overloaded_robot_refuses_does_not_end_the_session() -> None:
    """It has no room for another connection now, or takes the lane that was lost for open still."""
    robot = Robot()
    async with driving(robot) as session:
        robot.opens_with = Overloaded("this session has three lanes")
        robot.lanes[-1].lost = True
        await until(lambda: robot.refused >= 2, "the lane is refused, and tried again")
        holds = await more_commands(robot, 10, partial(session.hold, SPEED_MPS))
        assert holds[-5:] == [True] * 5
        assert (session.open_lanes, session.error) == (LANES - 1, None)
        robot.opens_with = None
        await until(lambda: session.open_lanes == LANES, "there is room again")


@pytest.mark.parametrize(
    ("max_lanes", "opened"), [(0, 2), (1, 1), (2, 2), (LANES, LANES), (LANES + 1, LANES)]
)
async def test_a_session_has_as_many_lanes_as_both_sides_take(max_lanes: int, opened: int) -> None:
    """0: a gateway of before there were three, which takes two."""
    robot = Robot()
    robot.max_lanes = max_lanes
    async with driving(robot) as session:
        assert (session.open_lanes, len(robot.lanes)) == (opened, opened)


async def test_a_picture_that_raises_ends_the_session_with_its_error_and_a_release() -> None:
    robot = Robot()

    def picture() -> int:
        if len(robot.commands) >= 3:
            raise ValueError("a defect")
        return 7

    options = DriveOptions(picture=picture)
    async with DriveSession(robot.connect, options, opens_within_s=5.0) as session:
        await until(lambda: session.error, "it has ended")
        with pytest.raises(Cancelled, match="a defect"):
            session.check()
    assert robot.finished == LANES
    assert not robot.held
    assert robot.commands[-1].picture_monotonic_ns == 7


async def test_a_velocity_that_is_no_number_is_refused_and_holds_nothing() -> None:
    robot = Robot()
    async with driving(robot) as session:
        with pytest.raises(ValueError, match="finite"):
            session.hold(float("nan"))
        assert not any(await more_commands(robot, 5))


@contextmanager
def driving_in_a_thread(robot: Robot) -> Iterator[BlockingDriveSession]:
    loop = LoopThread()
    try:
        with BlockingDriveSession(loop, DriveSession(robot.connect, DriveOptions(), 5.0)) as session:
            session.ready(within_s=5.0)
            yield session
    finally:
        loop.stop()


def test_blocking_code_sees_what_the_loop_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Robot()
    with driving_in_a_thread(robot) as session:
        states = session.states()
        first, second = next(states), next(states)
        assert first.monotonic_ns < second.monotonic_ns
        assert session.is_ready
        assert session.state_age_s < 5.0
        assert session.open_lanes == LANES
        session.hold(SPEED_MPS)
        next(state for state in states if robot.held)
        have_holds_count_for(monkeypatch, HOLD_COUNTS_S)
        next(state for state in states if not robot.held)
        session.hold(SPEED_MPS)
        assert (session.lapsed, session.error) == (True, None)
        robot.ends_with = Refused("taken over")
        with pytest.raises(Refused, match="taken over"):
            for _ in states:
                pass
        assert session.error is robot.ends_with
