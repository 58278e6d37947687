"""Lists of files that come a page at a time are whole, or an error."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from console.client import results
from console.client.errors import GatewayFailed, InvalidRequest, Unsupported
from console.client.results import (
    RecordingFile,
    RecordingFound,
    RecordingGap,
    RecordingGapCause,
    RecordingState,
)
from console.client.whole_recording import LISTS, MOST_PAGES, with_all_files
from tests.support.played_recordings import ENDED

GAP = RecordingGap(cause=RecordingGapCause.DISK, began_unix_ms=1, ended_unix_ms=2, messages=None)


def files(begin: int, end: int) -> tuple[RecordingFile, ...]:
    return tuple(
        RecordingFile(name=f"data/{number:06}.mcap", size=1, sha256=b"s" * 32, final=True)
        for number in range(begin, end)
    )


def found(listed: tuple[RecordingFile, ...], token: str = "", **more: Any) -> RecordingFound:
    values: dict[str, Any] = {"file_count": 7, "size": 7, "sha256": b"a" * 32, **more}
    return RecordingFound(
        recording=replace(ENDED, files=listed, **values),
        next_page_token=token,
    )


class Robot:
    """Answers with the next page, or raises it."""

    def __init__(self, *answers: RecordingFound | Exception) -> None:
        self.answers = list(answers)
        self.tokens: list[str] = []

    async def page(self, token: str) -> RecordingFound:
        self.tokens.append(token)
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


def names(recording: results.Recording) -> Sequence[str]:
    return [file.name for file in recording.files]


async def test_the_pages_are_put_together_in_order_with_the_gaps_of_the_first() -> None:
    robot = Robot(found(files(0, 3), "c", gaps=(GAP,)), found(files(3, 6), "f"), found(files(6, 7)))
    whole = await with_all_files(robot.page)
    assert names(whole) == names(found(files(0, 7)).recording)
    assert (whole.gaps, robot.tokens) == ((GAP,), ["", "c", "f"])


async def test_a_robot_without_pages_that_lists_a_part_is_never_taken_for_whole() -> None:
    with pytest.raises(Unsupported, match="only 3 of the 7 files"):
        await with_all_files(Robot(found(files(0, 3))).page)


async def test_a_list_that_changes_between_two_pages_is_begun_anew() -> None:
    before: dict[str, Any] = {"sha256": b"b" * 32}
    after: dict[str, Any] = {"file_count": 6, "size": 6}
    robot = Robot(
        found(files(0, 3), "c", **before),
        found(files(3, 7)),
        found(files(0, 3), "c"),
        InvalidRequest("the file is gone"),
        found(files(0, 3), "c", **after),
        found(files(3, 6), **after),
    )
    assert names(await with_all_files(robot.page)) == names(found(files(0, 6)).recording)
    changing = [found(files(0, 3), "c", **before), found(files(3, 7))] * LISTS
    with pytest.raises(GatewayFailed, match="changes while"):
        await with_all_files(Robot(*changing).page)


async def test_a_file_that_is_listed_twice_is_a_change() -> None:
    twice = [found(files(0, 4), "c"), found(files(3, 7))] * LISTS
    with pytest.raises(GatewayFailed, match="changes while"):
        await with_all_files(Robot(*twice).page)


async def test_to_a_recording_that_runs_files_are_added_meanwhile() -> None:
    runs: dict[str, Any] = {"state": RecordingState.RECORDING, "sha256": b""}
    robot = Robot(
        found(files(0, 3), "c", **runs, file_count=4, size=4),
        found(files(3, 6), **runs, file_count=6, size=6),
    )
    whole = await with_all_files(robot.page)
    assert (len(whole.files), whole.file_count) == (6, 6)


async def test_pages_without_an_end_are_an_error() -> None:
    endless = [found(files(at, at + 1), str(at), file_count=1 << 31) for at in range(MOST_PAGES + 1)]
    with pytest.raises(GatewayFailed, match="without an end"):
        await with_all_files(Robot(*endless).page)
