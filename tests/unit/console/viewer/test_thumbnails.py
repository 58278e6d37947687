"""Pictures of recordings: decoded once, found again, and so many of them."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from common.trial import TrialError
from console.client.errors import Refused
from console.client.results import RecordingThumbnail
from console.receiver.key_frame import PICTURE_BYTES
from console.viewer import thumbnails as module
from console.viewer.thumbnails import Thumbnails, cache_directory
from tests.support.played_recordings import ENDED

PICTURE = bytes(PICTURE_BYTES)
FETCHED = RecordingThumbnail(key_frame=b"frame", format="h264", captured_unix_ms=1)


class Decoder:
    """Decodes as the test sets it up."""

    def __init__(self) -> None:
        self.calls: list[tuple[bytes, str]] = []
        self.error: TrialError | None = None

    async def __call__(self, key_frame: bytes, codec: str) -> bytes:
        self.calls.append((key_frame, codec))
        if self.error:
            raise self.error
        return PICTURE


def files(directory: Path) -> set[Path]:
    return set(directory.iterdir())


async def fetch() -> RecordingThumbnail:
    return FETCHED


async def refuse() -> RecordingThumbnail:
    raise Refused("it has no key frame")


async def test_a_picture_is_decoded_once_and_kept_for_the_next_window(tmp_path: Path) -> None:
    decoder = Decoder()
    for _ in range(2):
        assert await Thumbnails(tmp_path / "cache", decoder).picture(ENDED, fetch) == PICTURE
    assert decoder.calls == [(b"frame", "h264")]
    assert (tmp_path / "cache").stat().st_mode & 0o777 == 0o700
    assert await Thumbnails(tmp_path / "cache", decoder).picture(ENDED, refuse) == PICTURE


async def test_another_content_is_another_picture(tmp_path: Path) -> None:
    decoder = Decoder()
    made = Thumbnails(tmp_path, decoder)
    await made.picture(ENDED, fetch)
    await made.picture(replace(ENDED, sha256=b"y" * 32), fetch)
    assert len(decoder.calls) == 2


async def test_what_can_not_be_decoded_is_no_picture_and_is_not_kept(tmp_path: Path) -> None:
    decoder = Decoder()
    decoder.error = TrialError("it crashed")
    assert await Thumbnails(tmp_path, decoder).picture(ENDED, fetch) == b""
    assert not files(tmp_path)


async def test_a_refusal_is_the_callers(tmp_path: Path) -> None:
    with pytest.raises(Refused):
        await Thumbnails(tmp_path, Decoder()).picture(ENDED, refuse)


async def test_a_file_of_another_size_is_made_anew(tmp_path: Path) -> None:
    decoder = Decoder()
    made = Thumbnails(tmp_path, decoder)
    await made.picture(ENDED, fetch)
    (kept,) = files(tmp_path)
    for content in (b"", PICTURE + b"x"):
        kept.write_bytes(content)
        assert await made.picture(ENDED, fetch) == PICTURE
    assert len(decoder.calls) == 3


async def test_the_oldest_give_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_KEPT", 3)
    made = Thumbnails(tmp_path, Decoder())
    for number in range(5):
        before = files(tmp_path)
        await made.picture(replace(ENDED, id=str(number)), fetch)
        (new,) = files(tmp_path) - before
        os.utime(new, (number, number))
    assert sorted(each.stat().st_mtime for each in files(tmp_path)) == [2, 3, 4]


async def test_a_folder_that_can_not_be_written_costs_no_picture(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file is in its place")
    assert await Thumbnails(tmp_path / "cache", Decoder()).picture(ENDED, fetch) == PICTURE


def test_where_they_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_directory() == tmp_path / "robotctl/thumbnails"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache_directory() == Path.home() / ".cache/robotctl/thumbnails"
