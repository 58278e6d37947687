"""`robotctl view` as a user starts it: another process, its exit code and what it printed."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from console.client import GatewayClient
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.judges import decoded_frames
from tests.support.patient import PATIENT
from tests.support.robotctl import (
    ENDS_WITHIN_S,
    ROBOTCTL,
    environment,
    only_line,
    robotctl_process,
    viewed,
)
from tests.support.robotctl_docs import documented, holds
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst

HIDING = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {library!r}:
            raise ModuleNotFoundError("No module named " + repr(name), name=name)
sys.meta_path.insert(0, Hidden())
"""


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VideoGround]:
    """The preview is on."""
    with video_ground(tmp_path_factory.mktemp("ground")) as ground:
        ground.switch_on()
        yield ground


def without(library: str, directory: Path) -> str:
    """A PYTHONPATH with which this library can't be imported."""
    (directory / "sitecustomize.py").write_text(HIDING.format(library=library), encoding="utf-8")
    return os.pathsep.join([str(directory), *filter(None, [os.environ.get("PYTHONPATH")])])


def test_frames_are_counted_in_one_line(running: VideoGround) -> None:
    done = viewed("--target", running.target, "view", "--headless", "--frames", "20")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    said = only_line(done.stdout)
    assert "320x240 h264 by avdec_h264, first after " in said
    assert int(said.split()[0]) >= 20


def test_the_json_has_exactly_the_documented_keys(running: VideoGround, tmp_path: Path) -> None:
    file = tmp_path / "kept.ts"
    command = ["view", "--headless", "--frames", "20", "--record", str(file)]
    done = viewed("--target", running.target, "--json", *command)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    holds(documented("view --json"), document, complete=True)
    assert document["pictures"] >= 20
    assert document["recording"] == {"file": str(file), "bytes": file.stat().st_size, "gaps": 0}
    assert decoded_frames(file) >= 20


def test_a_stream_on_the_network_is_encrypted_and_opens_without_a_login(tmp_path: Path) -> None:
    """As through a tunnel to a robot without credentials."""
    with video_ground(tmp_path, {"srt": {"bind": "0.0.0.0"}}) as ground:  # noqa: S104  # what this test is about
        ground.switch_on()
        status = json.loads(robotctl_process("--target", ground.target, "--json", "status").stdout)
        assert status["preview"]["endpoint"]["encrypted"]
        assert "passphrase" not in status["preview"]["endpoint"]
        done = viewed("--target", ground.target, "view", "--headless", "--frames", "20")
        assert (done.returncode, done.stderr) == (0, "")


def test_it_ends_cleanly_on_a_signal(running: VideoGround, tmp_path: Path) -> None:
    file = tmp_path / "kept.ts"
    command = [str(ROBOTCTL), "--target", running.target, "view", "--headless", "--record", str(file)]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True) as viewing:
        try:
            wait_until(lambda: file.exists() and file.stat().st_size > 50_000, "something is kept", 30)
            viewing.send_signal(signal.SIGINT)
            said, _ = viewing.communicate(timeout=ENDS_WITHIN_S)
        finally:
            viewing.kill()
    assert viewing.returncode == 0
    assert "kept.ts: " in only_line(said)
    assert decoded_frames(file) > 0


def test_the_window_shows_and_closes(running: VideoGround, tmp_path: Path) -> None:
    command = [
        str(ROBOTCTL),
        "--target",
        running.target,
        "--json",
        "view",
        "--record",
        str(tmp_path / "kept.ts"),
    ]
    offscreen = environment(QT_QPA_PLATFORM="offscreen")
    with subprocess.Popen(
        command, env=offscreen, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as viewing:
        try:
            kept = tmp_path / "kept.ts"
            wait_until(lambda: kept.exists() and kept.stat().st_size > 50_000, "something is kept", 30)
            viewing.send_signal(signal.SIGTERM)
            said, complaints = viewing.communicate(timeout=ENDS_WITHIN_S)
        finally:
            viewing.kill()
    assert viewing.returncode == 0, complaints
    assert json.loads(said)["pictures"] > 0
    assert "Traceback" not in complaints


def test_a_full_disk_is_one_line(running: VideoGround) -> None:
    done = viewed(
        "--target", running.target, "view", "--headless", "--frames", "500", "--record", "/dev/full"
    )
    assert done.returncode == 1
    assert "ended early: No space left" in only_line(done.stderr)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--frames", "3"], "--frames is for --headless"),
        (["--headless", "--frames", "0"], "frames"),
        (["--headless", "--record", __file__], "exists already"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_2(words: list[str], said: str) -> None:
    done = robotctl_process("--target", f"127.0.0.1:{free_tcp_port()}", "view", *words)
    assert done.returncode == 2
    assert said in only_line(done.stderr)


def test_a_place_that_cannot_be_written_is_one_line_and_1() -> None:
    done = robotctl_process("view", "--headless", "--record", "/nowhere/kept.ts")
    assert done.returncode == 1
    assert "/nowhere/kept.ts can't be written" in only_line(done.stderr)


def test_no_gateway_is_one_line_and_3_and_leaves_no_file(tmp_path: Path) -> None:
    file = tmp_path / "kept.ts"
    command = ["view", "--headless", "--frames", "3", "--record", str(file)]
    done = robotctl_process("--target", f"127.0.0.1:{free_tcp_port()}", *command)
    assert done.returncode == 3
    assert "nothing listens there" in only_line(done.stderr)
    assert not file.exists()


@pytest.mark.parametrize("words", [["--headless"], []], ids=["headless", "window"])
def test_a_login_that_can_not_be_used_is_one_line_and_2_and_leaves_no_file(
    tmp_path: Path, words: list[str]
) -> None:
    book, token, file = tmp_path / "robotctl/config.toml", tmp_path / "token", tmp_path / "kept.ts"
    token.write_text("x")
    token.chmod(0o644)
    book.parent.mkdir()
    book.write_text(f'[robots.lab]\ntarget = "127.0.0.1"\ntoken_file = "{token}"\n')
    done = robotctl_process(
        *("--robot", "lab", "view", *words, "--record", str(file)),
        XDG_CONFIG_HOME=str(tmp_path),
        QT_QPA_PLATFORM="offscreen",
    )
    assert done.returncode == 2
    assert f"chmod 600 {token}" in only_line(done.stderr)
    assert not file.exists()


def test_a_preview_that_is_off_is_one_line_and_1() -> None:
    with serving(GatewayDouble()) as port:
        done = viewed("--target", f"127.0.0.1:{port}", "view", "--headless", "--frames", "3")
    assert done.returncode == 1
    expected = f"error: the preview is off. Type: robotctl --target 127.0.0.1:{port} preview on"
    assert only_line(done.stderr) == expected


@contextmanager
def claiming_to_run(words: str = "") -> Iterator[str]:
    """A gateway whose preview runs, as it says; its stream's port has no listener."""
    double = GatewayDouble()
    double.works = not words
    double.fault = words
    with serving(double) as port:
        target = f"127.0.0.1:{port}"
        with GatewayClient(target, PATIENT) as client:
            assert client.enable_preview().accepted
        double.status.preview.endpoint.port = free_tcp_port()
        yield target


def test_a_stream_that_does_not_come_is_one_line_and_3() -> None:
    """SRT gives up after 3 s, and a machine that stands still needs time beyond that."""
    with claiming_to_run() as target:
        done = robotctl_process("--target", target, "view", "--headless", "--frames", "3", "--patience", "8")
    assert done.returncode == 3
    said = only_line(done.stderr)
    assert "no frame for 8 s: the preview is running; no SRT listener answers" in said
    assert said.endswith(f"Look at: robotctl --target {target} doctor")


def test_a_faulted_preview_is_one_line_and_1() -> None:
    with claiming_to_run("the camera is gone. Plug it in") as target:
        done = viewed("--target", target, "view", "--headless", "--frames", "3", "--patience", "5")
    assert done.returncode == 1
    assert "the preview is faulted: the camera is gone. Plug it in" in only_line(done.stderr)


@pytest.mark.parametrize("words", [["view"], ["view", "--headless", "--frames", "1"]])
def test_without_gstreamer_one_line_says_what_to_install(tmp_path: Path, words: list[str]) -> None:
    done = robotctl_process(*words, PYTHONPATH=without("gi", tmp_path))
    assert done.returncode == 1
    said = only_line(done.stderr)
    assert said.startswith("error: video needs GStreamer")
    assert "sudo apt-get install " in said


def test_without_gstreamer_everything_else_works(tmp_path: Path) -> None:
    with serving(GatewayDouble()) as port:
        path = without("gi", tmp_path)
        assert robotctl_process("--target", f"127.0.0.1:{port}", "status", PYTHONPATH=path).returncode == 0


def test_without_qt_one_line_says_what_to_install(running: VideoGround, tmp_path: Path) -> None:
    path = without("PySide6", tmp_path)
    done = robotctl_process("--target", running.target, "view", PYTHONPATH=path)
    assert done.returncode == 1
    said = only_line(done.stderr)
    assert said.startswith("error: the window needs Qt")
    assert said.endswith("scripts/install-console")
    command = ["view", "--headless", "--frames", "3"]
    assert viewed("--target", running.target, *command, PYTHONPATH=path).returncode == 0


@pytest.mark.parametrize(
    ("display", "said"),
    [
        ({"DISPLAY": ""}, "no display"),
        ({"DISPLAY": "127.0.0.1:98", "QT_QPA_PLATFORM": "xcb"}, "Qt can't show"),
    ],
    ids=["none", "silent"],
)
def test_without_a_display_one_line_says_what_to_do_and_no_file_is_left(
    tmp_path: Path, display: dict[str, str], said: str
) -> None:
    given = environment(WAYLAND_DISPLAY="")
    given.pop("QT_QPA_PLATFORM", None)
    file = tmp_path / "kept.ts"
    done = subprocess.run(
        [ROBOTCTL, "view", "--record", str(file)],
        env=given | display,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    assert said in only_line(done.stderr)
    assert not file.exists()
