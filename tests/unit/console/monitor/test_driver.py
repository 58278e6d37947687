"""What a window asks of the robot besides its session: stops, resets, refusals."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field

import pytest

from console.client import (
    DriveOptions,
    DrivePhase,
    DriveSession,
    GatewayError,
    Refused,
    RobotStopped,
    StopLatch,
    Supervision,
    Unreachable,
)
from console.client.results import StopReset, TeleopAnswer
from console.monitor.driver import Driver
from console.presentation.severity_style import SeverityStyle
from tests.support.eventually import eventually
from tests.support.snapshots import snapshot

LATCH = StopLatch(stop_id=7, by="anna", reason="", age_ms=0)


@dataclass
class PlayedClient:
    """Answers as the test sets it up."""

    error: GatewayError | None = None
    answers: asyncio.Event = field(default_factory=asyncio.Event)
    stops: list[str] = field(default_factory=list)
    confirmed: int = 0
    resets: list[int] = field(default_factory=list)
    opened: list[DriveOptions | None] = field(default_factory=list)
    switched: list[bool] = field(default_factory=list)
    accepts: bool = True

    @property
    def client(self) -> "PlayedClient":
        return self

    def drive(self, options: DriveOptions | None = None) -> DriveSession:
        self.opened.append(options)
        raise Refused("another one drives", "Take over")

    async def stop_robot(self, reason: str = "") -> RobotStopped:
        self.stops.append(reason)
        await self.answers.wait()
        if self.error:
            raise self.error
        self.confirmed += 1
        return RobotStopped(message="the robot is stopped", stop=LATCH)

    async def reset_stop(self, stop_id: int) -> StopReset:
        self.resets.append(stop_id)
        if self.error:
            raise self.error
        return StopReset(message="the stop is reset", phase=DrivePhase.AVAILABLE)

    async def set_driving_enabled(self, enabled: bool) -> TeleopAnswer:
        self.switched.append(enabled)
        if self.error:
            raise self.error
        return TeleopAnswer(accepted=self.accepts, message="as asked", teleop=snapshot().status.teleop)


@asynccontextmanager
async def served(client: PlayedClient) -> AsyncIterator[Driver]:
    loop = asyncio.get_running_loop()

    def call_soon(act: Callable[[], object]) -> None:
        loop.call_soon_threadsafe(act)

    driver = Driver(call_soon, lambda: None, lambda: 5)
    task = asyncio.create_task(driver.run(client))
    await asyncio.sleep(0)
    try:
        yield driver
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def note(driver: Driver) -> tuple[str, SeverityStyle]:
    async def taken() -> tuple[str, SeverityStyle] | None:
        notes = driver.take_notes()
        return (notes[0].text, notes[0].style) if notes else None

    found = await eventually(taken, bool, "a note")
    assert found
    return found


async def test_a_stop_is_pending_until_the_robot_has_confirmed_it() -> None:
    client = PlayedClient()
    async with served(client) as driver:
        driver.stop("why")
        await asyncio.sleep(0.01)
        assert driver.view().stopping
        assert client.stops == ["why"]
        client.answers.set()
        assert await note(driver) == ("Stopped: the robot is stopped", SeverityStyle.WARNING)
        assert not driver.view().stopping


async def test_an_unconfirmed_stop_is_reported() -> None:
    client = PlayedClient(error=Unreachable("no answer"))
    client.answers.set()
    async with served(client) as driver:
        driver.stop("why")
        text, style = await note(driver)
    assert text.startswith("The robot has NOT confirmed the stop: no answer")
    assert style is SeverityStyle.BAD


async def test_each_press_is_sent_but_no_more_than_four_are_on_their_way() -> None:
    client = PlayedClient()
    async with served(client) as driver:
        for _ in range(9):
            driver.stop("again")
        await asyncio.sleep(0.01)
        assert len(client.stops) == 4
        client.answers.set()
        await note(driver)
        driver.stop("later")
        await asyncio.sleep(0.01)
        assert client.stops[-1] == "later"


async def test_a_window_that_is_closed_waits_for_its_stop() -> None:
    client = PlayedClient()
    async with served(client) as driver:
        driver.stop("and away")
        await asyncio.sleep(0.01)
        asyncio.get_running_loop().call_later(0.05, client.answers.set)
    assert client.confirmed == 1


async def test_the_shown_stop_is_reset_and_a_refusal_said() -> None:
    client = PlayedClient()
    async with served(client) as driver:
        driver.reset(7)
        assert await note(driver) == ("the stop is reset", SeverityStyle.QUIET)
        client.error = Refused("a newer stop is latched")
        driver.reset(7)
        text, style = await note(driver)
    assert client.resets == [7, 7]
    assert text.startswith("Not reset: a newer stop is latched")
    assert style is SeverityStyle.BAD


async def test_a_refused_session_leaves_room_for_the_next() -> None:
    client = PlayedClient()
    async with served(client) as driver:
        for supervision in (Supervision.PICTURE, Supervision.LINE_OF_SIGHT):
            driver.begin(supervision, take_over=True)
            text, _ = await note(driver)
            assert text.startswith("Not driving: another one drives")
            assert not driver.view().opening
            assert not driver.view().open
    by_picture, by_eye = client.opened
    assert by_picture
    assert by_eye
    assert by_picture.picture
    assert by_picture.picture() == 5
    assert (by_eye.picture, by_eye.take_over) == (None, True)


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("accepts", [True, False])
async def test_driving_is_enabled_or_disabled_or_the_refusal_said(accepts: bool, enabled: bool) -> None:
    client = PlayedClient(accepts=accepts)
    async with served(client) as driver:
        driver.set_enabled(enabled)
        _, style = await note(driver)
    assert client.switched == [enabled]
    assert style is (SeverityStyle.QUIET if accepts else SeverityStyle.BAD)


@pytest.mark.parametrize(("enabled", "wanted"), [(True, "enabled"), (False, "disabled")])
async def test_a_switch_without_an_answer_is_reported(enabled: bool, wanted: str) -> None:
    async with served(PlayedClient(error=Unreachable("no answer"))) as driver:
        driver.set_enabled(enabled)
        text, style = await note(driver)
    assert text.startswith(f"Driving is not {wanted}: no answer")
    assert style is SeverityStyle.BAD
