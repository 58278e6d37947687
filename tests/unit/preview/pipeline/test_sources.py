"""Sources as plans: what is checked before GStreamer is asked."""

import socket
from pathlib import Path

import pytest

from common.errors import UserError
from preview.config import (
    CameraTapSettings,
    FileSource,
    GstSource,
    PreviewSettings,
    RosSource,
    Source,
    TestSource,
    V4l2Source,
)
from preview.pipeline import sources
from preview.pipeline.sources import SourcePlan


def planned(source: Source) -> SourcePlan:
    return sources.plan_camera(PreviewSettings(source=source), "camera")


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
    assert planned(TestSource()).any_rate
    file = planned(FileSource(path=film))
    assert (file.any_rate, file.loops) == (False, True)
    assert file.properties["file"]["location"] == str(film)
    described = planned(GstSource(description="videotestsrc"))
    assert (described.any_rate, described.loops, described.description) == (False, False, "videotestsrc")


def test_a_camera_is_asked_for_the_fastest_profile_or_what_is_configured() -> None:
    # Any character device will do for a plan.
    assert planned(V4l2Source(device="/dev/null")).capture_fps == 60
    assert planned(V4l2Source(device="/dev/null", fps=25)).capture_fps == 25


@pytest.mark.parametrize("content", [None, b""])
def test_a_film_that_can_not_be_played_is_named(tmp_path: Path, content: bytes | None) -> None:
    film = tmp_path / "film.mkv"
    if content is not None:
        film.write_bytes(content)
    with pytest.raises(UserError, match=str(film)):
        planned(FileSource(path=film))
    with pytest.raises(UserError, match="Is a directory"):
        planned(FileSource(path=tmp_path))


def test_a_topic_goes_by_way_of_the_camera_tap_which_must_be_there(tmp_path: Path) -> None:
    path = tmp_path / "tap.sock"
    settings = PreviewSettings(
        cameras={"arm": RosSource(topic="/arm/image_raw", fps=15), "top": RosSource(topic="/top")},
        camera_tap=CameraTapSettings(socket=path),
    )
    with pytest.raises(
        UserError, match=r"camera arm: topic /arm/image_raw .* not running\). Start it: robot-tap"
    ):
        sources.plan_camera(settings, "arm")
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen()
        plan = sources.plan_camera(settings, "arm")
        assert plan.label == "camera arm (topic /arm/image_raw)"
        assert plan.properties["tap"] == {"socket": str(path), "topic": "/arm/image_raw", "fps": "15"}
        assert sources.plan_camera(settings, "top").properties["tap"]["fps"] == "60"
    with pytest.raises(UserError, match="not running"):
        sources.plan_camera(settings, "arm")
