"""Sources as plans: what is checked before GStreamer is asked."""

import os
import re
import socket
import stat
from pathlib import Path
from typing import Any

import pytest

from common.errors import UserError
from preview.camera_watch import problems
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
from preview.pipeline import sources, tap_client
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


def test_a_node_without_a_device_is_no_camera(tmp_path: Path) -> None:
    """In a container the node stays when the camera is unplugged, and with it the camera counted as there."""
    camera, other = os.makedev(81, 11), os.makedev(81, 12)
    (tmp_path / "81:11").mkdir()
    assert sources.is_plugged_in(camera, tmp_path)
    assert not sources.is_plugged_in(other, tmp_path)
    assert sources.is_plugged_in(other, tmp_path / "nothing"), "where the kernel's list is not to be seen"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes device nodes")
def test_a_camera_whose_node_alone_is_there_is_said_to_be_unplugged(tmp_path: Path) -> None:
    node = tmp_path / "video11"
    os.mknod(node, stat.S_IFCHR | 0o600, os.makedev(81, 4000))
    with pytest.raises(UserError, match="is not plugged in"):
        planned(V4l2Source(device=str(node)))


def test_the_test_pattern_makes_any_rate_and_the_others_do_not(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    film.write_bytes(b"x")
    assert planned(TestSource()).any_rate
    file = planned(FileSource(path=film))
    assert (file.any_rate, file.loops) == (False, True)
    assert file.properties["file"]["location"] == str(film)
    assert planned(GstSource(description="videotestsrc", silence_s=5.0)).silence_s == 5.0
    described = planned(GstSource(description="videotestsrc"))
    assert (described.any_rate, described.loops, described.description) == (False, False, "videotestsrc")


def asked_for(**settings: Any) -> list[str]:
    """The caps that a camera is asked for, the preferred ones first."""
    # Any character device will do for a plan.
    plan = planned(V4l2Source(device="/dev/null", **settings))
    found = re.fullmatch(
        r'v4l2src name=camera do-timestamp=true ! capsfilter caps="(.+)" ! cameradecoder', plan.description
    )
    assert found
    return found[1].split("; ")


def test_a_camera_is_asked_for_the_fastest_profile_or_what_is_configured() -> None:
    assert all("framerate=[1/1,60/1]" in caps for caps in asked_for())
    assert all("framerate=[1/1,25/1]" in caps for caps in asked_for(fps=25))


def test_a_camera_is_asked_for_frames_of_the_largest_profile_before_larger_ones() -> None:
    assert asked_for(format="raw") == [
        "video/x-raw,width=[1,1280],height=[1,720],framerate=[1/1,60/1]",
        "video/x-raw,framerate=[1/1,60/1]",
    ]


@pytest.mark.parametrize(
    ("form", "media"),
    [
        ("auto", ["video/x-raw", "image/jpeg"]),
        ("raw", ["video/x-raw"]),
        ("jpeg", ["image/jpeg"]),
    ],
)
def test_a_camera_is_asked_for_the_configured_formats(form: str, media: list[str]) -> None:
    assert [caps.partition(",")[0] for caps in asked_for(format=form)] == 2 * media


def test_only_a_camera_that_is_bound_to_a_format_is_explained_that_it_need_not_be() -> None:
    assert "format: auto" not in planned(V4l2Source(device="/dev/null")).remedy
    assert "format: auto" in planned(V4l2Source(device="/dev/null", format="raw")).remedy


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


@pytest.mark.parametrize("problem", ["nothing publishes /arm/image_rwa", "", None])
def test_a_topic_that_nothing_publishes_is_seen_before_it_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, problem: str | None
) -> None:
    path, asked = tmp_path / "tap.sock", list[tuple[Path, str]]()

    def topic_problem(path: Path, topic: str, *_: Any) -> str | None:
        asked.append((path, topic))
        return problem

    monkeypatch.setattr(tap_client, "topic_problem", topic_problem)
    settings = PreviewSettings(
        cameras={"arm": RosSource(topic="/arm/image_rwa"), "front": TestSource()},
        camera_tap=CameraTapSettings(socket=path),
    )
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen()
        found = problems(settings, ("arm", "front"))
    assert asked == [(path, "/arm/image_rwa")]
    assert found.pop("front") == ""
    if not problem:
        assert found == ({} if problem is None else {"arm": ""})
    else:
        assert found["arm"].startswith(f"camera arm: {problem}. 'robot-tap doctor' lists")
