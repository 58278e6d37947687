"""Recordings from a window: lists, changes, pictures and copies, with a robot that the test plays."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from console.client import ExportedRecording, ExportOptions, ExportProgress, GatewayError, Recording
from console.client.errors import GatewayFailed, NotAllowed, Overloaded, Refused, Unreachable
from console.client.results import RecorderState, RecordingThumbnail
from console.monitor import recordings as module
from console.monitor.recordings import Recordings
from console.monitor.recordings_view import Change, ChangeRequest, ExportState
from console.presentation.severity_style import SeverityStyle
from tests.support.eventually import eventually
from tests.support.played_recordings import ENDED, IDLE, RECORDS, PlayedRecordings

FOLDER = Path("somewhere")


@dataclass
class PlayedPictures:
    """Makes pictures at once."""

    made: list[str]

    async def picture(
        self, recording: Recording, fetch: Callable[[], Awaitable[RecordingThumbnail]]
    ) -> bytes:
        self.made.append(recording.id)
        return (await fetch()).key_frame + b" decoded"


@dataclass
class Served:
    """What runs."""

    recordings: Recordings
    robot: PlayedRecordings
    pictures: PlayedPictures

    async def until(self, condition: Callable[[], object], what: str) -> None:
        async def found() -> object:
            return condition()

        await eventually(found, bool, what)

    async def note(self) -> tuple[str, SeverityStyle]:
        taken = []

        def take() -> bool:
            taken.extend(self.recordings.take_notes())
            return bool(taken)

        await self.until(take, "a note")
        return taken[0].text, taken[0].style


@asynccontextmanager
async def served() -> AsyncIterator[Served]:
    loop, robot, pictures = asyncio.get_running_loop(), PlayedRecordings(), PlayedPictures([])

    def call_soon(act: Callable[[], object]) -> None:
        loop.call_soon_threadsafe(act)

    recordings = Recordings(call_soon, lambda: None, robot.another, pictures)
    task = asyncio.create_task(recordings.run(robot))
    await asyncio.sleep(0)
    try:
        yield Served(recordings, robot, pictures)
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


@pytest.fixture(autouse=True)
def without_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_LEAST_BETWEEN_LISTS_S", "_LEAST_BETWEEN_PICTURES_S", "_PICTURES_AGAIN_S"):
        monkeypatch.setattr(module, name, 0.01)


async def test_nothing_is_listed_before_the_recorder_is_known_to_answer() -> None:
    async with served() as now:
        now.recordings.follow(None, shown=True)
        now.recordings.follow(replace(IDLE, state=RecorderState.UNREACHABLE), shown=True)
        await asyncio.sleep(0.05)
        assert now.robot.listings == 0
        assert now.recordings.view().listed is None


async def test_the_list_is_requested_once_for_each_change() -> None:
    async with served() as now:
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.recordings.view().listed == (ENDED,), "the list")
        for size in range(100):
            now.recordings.follow(replace(IDLE, size=size, room_bytes=size), shown=False)
        await asyncio.sleep(0.05)
        assert now.robot.listings == 1, "a size that grows is no reason"
        now.recordings.follow(replace(IDLE, recordings=2), shown=False)
        await now.until(lambda: now.robot.listings == 2, "a change")


async def test_while_it_is_shown_it_is_listed_again_without_a_change(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_LIST_EVERY_S", 0.02)
    async with served() as now:
        now.recordings.follow(IDLE, shown=True)
        await now.until(lambda: now.robot.listings >= 3, "lists")


async def test_a_list_that_can_not_be_had_leaves_what_was_listed() -> None:
    async with served() as now:
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.recordings.view().listed, "the list")
        now.robot.list_error = Unreachable("no robot there")
        now.recordings.follow(RECORDS, shown=False)
        await now.until(lambda: "no robot there" in now.recordings.view().problem, "why")
        assert now.recordings.view().listed == (ENDED,)
        now.robot.list_error = None
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: not now.recordings.view().problem, "it is mended")


async def test_no_more_is_listed_than_a_page_has() -> None:
    async with served() as now:
        now.robot.recordings = tuple(replace(ENDED, id=str(number)) for number in range(300))
        now.robot.more = "token"
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.recordings.view().more, "the list")
        assert len(now.recordings.view().listed or ()) == module.MOST_LISTED


@pytest.mark.parametrize(
    ("act", "asked"),
    [
        (lambda r: r.start("lap 1", "driving"), ("start", "lap 1", "driving")),
        (lambda r: r.stop("one"), ("stop", "one")),
        (lambda r: r.keep("odd", 30), ("keep", "odd", 30)),
        (lambda r: r.pin("one", True), ("pin", "one", True)),
        (lambda r: r.delete(ENDED), ("delete", "one", ENDED.sha256)),
    ],
)
async def test_what_is_asked_is_done_and_listed_anew(
    act: Callable[[Recordings], None], asked: tuple[object, ...]
) -> None:
    async with served() as now:
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.robot.listings == 1, "the list")
        act(now.recordings)
        _, style = await now.note()
        assert style is SeverityStyle.QUIET
        assert now.robot.asked == [asked]
        await now.until(lambda: now.robot.listings == 2, "another list")


async def test_what_is_pending_is_not_asked_twice() -> None:
    async with served() as now:
        now.robot.answers.clear()
        now.recordings.start("", "")
        await now.until(lambda: ChangeRequest(Change.START) in now.recordings.view().pending, "it is pending")
        now.recordings.start("", "")
        now.recordings.pin("one", True)
        await now.until(lambda: len(now.robot.asked) == 2, "something else may be asked meanwhile")
        now.robot.answers.set()
        await now.until(lambda: not now.recordings.view().pending, "the answers")
        assert [asked[0] for asked in now.robot.asked] == ["start", "pin"]


async def test_a_refusal_is_said_in_the_robots_words() -> None:
    async with served() as now:
        now.robot.refusal = Refused("another recording runs", "Stop it")
        now.recordings.start("", "")
        text, style = await now.note()
        assert "another recording runs" in text
        assert style is SeverityStyle.BAD
        assert not now.recordings.view().denied


async def test_a_role_that_does_not_suffice_is_remembered_until_another_login() -> None:
    async with served() as now:
        refusal = NotAllowed("StartRecording needs the role operator")
        refusal.reason = "ROLE_TOO_LOW"
        now.robot.refusal = refusal
        now.recordings.start("", "")
        await now.until(lambda: "role operator" in now.recordings.view().denied, "why")
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.robot.listings, "a list")
        assert now.recordings.view().denied
        now.recordings._robot = PlayedRecordings()
        now.recordings.follow(RECORDS, shown=False)
        await now.until(lambda: not now.recordings.view().denied, "another login")


async def test_only_what_can_be_seen_gets_a_picture_and_once() -> None:
    async with served() as now:
        now.recordings.show_pictures((ENDED,))
        await now.until(lambda: now.recordings.view().pictures == {"one": b"frame decoded"}, "the picture")
        now.recordings.show_pictures((ENDED, replace(ENDED, id="two")))
        await now.until(lambda: "two" in now.recordings.view().pictures, "the other one")
        assert now.pictures.made == ["one", "two"]


async def test_a_recording_that_is_gone_leaves_no_picture() -> None:
    async with served() as now:
        now.recordings.show_pictures((ENDED,))
        await now.until(lambda: now.recordings.view().pictures, "the picture")
        now.robot.recordings = ()
        now.recordings.follow(IDLE, shown=False)
        await now.until(lambda: now.recordings.view().listed == (), "the list")
        assert not now.recordings.view().pictures


async def test_a_refused_picture_is_none_and_a_lost_connection_is_no_answer() -> None:
    async with served() as now:
        now.robot.thumbnail_error = Unreachable("no robot there")
        now.recordings.show_pictures((ENDED,))
        await now.until(lambda: len(now.robot.asked) > 2, "further attempts")
        busy = Overloaded("it reads for others")
        busy.reason = "TOO_MANY_REQUESTS"
        now.robot.thumbnail_error, asked = busy, len(now.robot.asked)
        await now.until(lambda: len(now.robot.asked) > asked + 1, "further attempts")
        assert not now.recordings.view().pictures
        refusal = Refused("it has no key frame")
        refusal.reason = "RECORDING_NOT_FOUND"
        now.robot.thumbnail_error = refusal
        await now.until(lambda: now.recordings.view().pictures == {"one": b""}, "none")


async def test_a_copy_shows_how_far_it_is_on_a_connection_of_its_own() -> None:
    go_on = asyncio.Event()

    async def export(folder: Path, options: ExportOptions) -> ExportedRecording:
        options.progress(ExportProgress("data/0", 1, 2, 40, 100))
        await go_on.wait()
        return ExportedRecording(folder=folder, files=2, size=100, received=100, cuts=0, not_final=())

    async with served() as now:
        now.robot.export = export
        now.recordings.export("one", FOLDER)
        await now.until(lambda: now.recordings.view().exporting == "one", "it runs")
        await now.until(lambda: now.recordings.view().exports["one"].done == 40, "how far it is")
        assert now.robot.connections == 1
        now.recordings.export("two", FOLDER)
        await asyncio.sleep(0.02)
        assert list(now.recordings.view().exports) == ["one"], "one at a time"
        go_on.set()
        text, style = await now.note()
        assert text == "somewhere: 2 files, 100 B, verified"
        assert style is SeverityStyle.GOOD
        assert now.recordings.view().exports["one"].state is ExportState.DONE
        assert now.robot.connections == 0


async def test_a_cancelled_copy_can_be_resumed() -> None:
    async def export(_folder: Path, options: ExportOptions) -> ExportedRecording:
        assert options.resume
        await asyncio.Event().wait()
        raise AssertionError

    async with served() as now:
        now.robot.export = export
        for _ in range(2):
            now.recordings.export("one", FOLDER)
            await now.until(lambda: now.recordings.view().exporting, "it runs")
            now.recordings.cancel_export()
            await now.until(lambda: not now.recordings.view().exporting, "it has ended")
            assert now.recordings.view().exports["one"].state is ExportState.CANCELLED
        assert now.robot.connections == 0


async def test_a_copy_that_fails_says_why() -> None:
    async def export(_folder: Path, _options: ExportOptions) -> ExportedRecording:
        raise GatewayFailed("data/0 arrived twice with another SHA-256", "Check the disk")

    async with served() as now:
        now.robot.export = export
        now.recordings.export("one", FOLDER)
        text, style = await now.note()
        assert text.startswith("Export failed: data/0 arrived twice")
        assert style is SeverityStyle.BAD
        assert now.recordings.view().exports["one"].state is ExportState.FAILED


async def test_a_closed_window_cancels_its_copy() -> None:
    async def export(_folder: Path, _options: ExportOptions) -> ExportedRecording:
        await asyncio.Event().wait()
        raise AssertionError

    async with served() as now:
        now.robot.export = export
        now.recordings.export("one", FOLDER)
        await now.until(lambda: now.robot.connections, "it runs")
    assert now.robot.connections == 0


async def test_so_many_ends_of_copies_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.monitor.exports._MOST_EXPORTS", 2)

    async def export(_folder: Path, _options: ExportOptions) -> ExportedRecording:
        raise GatewayError("no")

    async with served() as now:
        now.robot.export = export
        for name in ("one", "two", "three"):
            now.recordings.export(name, FOLDER)
            await now.note()
        assert list(now.recordings.view().exports) == ["two", "three"]
