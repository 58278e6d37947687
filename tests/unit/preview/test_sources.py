"""Sources as plans: what is checked before GStreamer is asked."""

from pathlib import Path

import pytest

from common.errors import UserError
from preview.config import FileSource, GstSource, TestSource, V4l2Source
from preview.pipeline import sources


def cards(directory: Path, **names: str) -> Path:
    for node, name in names.items():
        (directory / node).mkdir()
        (directory / node / "name").write_text(f"{name}\n", encoding="utf-8")
    return directory


def test_a_card_is_found_by_its_name_whatever_its_number(tmp_path: Path) -> None:
    found = cards(tmp_path, video2="rkisp_selfpath", video11="rkisp_mainpath", video9="rkisp_mainpath")
    assert sources.find_card("rkisp_mainpath", found) == "/dev/video9"
    assert sources.find_card("rkisp_selfpath", found) == "/dev/video2"


def test_a_card_that_is_not_there_names_those_that_are(tmp_path: Path) -> None:
    found = cards(tmp_path, video0="USB Camera", video1="USB Camera")
    with pytest.raises(UserError, match=r"no camera is called 'rkisp' \(found: USB Camera\)"):
        sources.find_card("rkisp", found)
    with pytest.raises(UserError, match=r"\(found: none\)"):
        sources.find_card("rkisp", tmp_path / "nothing")


def test_the_test_pattern_makes_any_rate_and_the_others_do_not(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    film.write_bytes(b"x")
    assert sources.plan(TestSource(), 60).any_rate
    file = sources.plan(FileSource(path=film), 60)
    assert (file.any_rate, file.loops) == (False, True)
    assert file.properties["file"]["location"] == str(film)
    described = sources.plan(GstSource(description="videotestsrc"), 60)
    assert (described.any_rate, described.loops, described.description) == (False, False, "videotestsrc")


def test_a_camera_is_asked_for_the_fastest_profile_or_what_is_configured() -> None:
    # Any character device will do for a plan.
    assert sources.plan(V4l2Source(device="/dev/null"), 60).capture_fps == 60
    assert sources.plan(V4l2Source(device="/dev/null", fps=25), 60).capture_fps == 25


@pytest.mark.parametrize("content", [None, b""])
def test_a_film_that_can_not_be_played_is_named(tmp_path: Path, content: bytes | None) -> None:
    film = tmp_path / "film.mkv"
    if content is not None:
        film.write_bytes(content)
    with pytest.raises(UserError, match=str(film)):
        sources.plan(FileSource(path=film), 60)
    with pytest.raises(UserError, match="Is a directory"):
        sources.plan(FileSource(path=tmp_path), 60)
