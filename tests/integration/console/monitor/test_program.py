"""`robotctl monitor` as a program: what it says when it can't open, how it ends."""

import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from tests.support.gateway_double import StreamingGatewayDouble, serving
from tests.support.promise import keeps
from tests.support.robotctl import ROBOTCTL, environment, only_line, robotctl_process
from tests.support.waiting import wait_until

ENDS_WITHIN_S = 2.0
NO_DISPLAY = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}


def test_without_a_display_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    ended = robotctl_process("monitor", **NO_DISPLAY)
    assert ended.returncode == 1
    assert "no display" in only_line(ended.stderr)
    assert "robotctl watch" in ended.stderr


def test_a_display_that_does_not_answer_is_one_line() -> None:
    ended = robotctl_process("monitor", QT_QPA_PLATFORM="xcb", DISPLAY="127.0.0.1:98")
    assert ended.returncode == 1
    assert only_line(ended.stderr).startswith("error: Qt can't show a window")


def test_without_qt_it_says_what_to_install(tmp_path: Path) -> None:
    package = tmp_path / "PySide6"
    package.mkdir()
    (package / "__init__.py").write_text(
        "raise ModuleNotFoundError('none', name='PySide6')", encoding="utf-8"
    )
    ended = robotctl_process("monitor", PYTHONPATH=str(tmp_path))
    assert ended.returncode == 1
    assert only_line(ended.stderr).endswith("Type, in a clone of the project: scripts/install-console")


def test_qt_without_a_library_of_the_system_says_what_to_install(tmp_path: Path) -> None:
    package = tmp_path / "PySide6"
    package.mkdir()
    reason = "libEGL.so.1: cannot open shared object file"
    (package / "__init__.py").write_text(f"raise ImportError('{reason}')", encoding="utf-8")
    ended = robotctl_process("monitor", PYTHONPATH=str(tmp_path))
    assert ended.returncode == 1
    assert reason in only_line(ended.stderr)
    assert "sudo apt install" in ended.stderr


def test_an_address_that_is_none_is_a_wrong_command_line() -> None:
    ended = robotctl_process("monitor", "--target", "http://robot/", QT_QPA_PLATFORM="offscreen")
    assert ended.returncode == 2
    assert "not the address" in only_line(ended.stderr)


@contextmanager
def opened(target: str, directory: Path) -> Iterator["subprocess.Popen[str]"]:
    """The program with its window, without a screen."""
    process = subprocess.Popen(
        [ROBOTCTL, "monitor", "--target", target],
        env=environment(QT_QPA_PLATFORM="offscreen", XDG_CONFIG_HOME=str(directory)),
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        if process.stderr:
            process.stderr.close()


@pytest.mark.timed
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_closes_it_in_the_middle_of_a_call(tmp_path: Path, number: signal.Signals) -> None:
    keeps(ENDS_WITHIN_S, "s from signal to end", partial(closed_during_a_call_s, tmp_path, number))
    assert list(tmp_path.rglob("monitor.ini")), "it remembers where it was"


def closed_during_a_call_s(tmp_path: Path, number: signal.Signals) -> float:
    gateway = StreamingGatewayDouble()
    with serving(gateway) as port, opened(f"127.0.0.1:{port}", tmp_path) as process:
        wait_until(lambda: len(gateway.calls) > 3 or process.poll() is not None, "it follows the robot", 30)
        gateway.hold.clear()
        asked = len(gateway.calls)
        wait_until(lambda: len(gateway.calls) > asked, "a call hangs")
        signalled_s = time.monotonic()
        process.send_signal(number)
        assert process.wait(20) == 0
        took_s = time.monotonic() - signalled_s
        gateway.hold.set()
        assert process.stderr
        assert process.stderr.read() == ""
    return took_s


@pytest.mark.timed
def test_a_robot_that_takes_the_call_and_never_says_a_word_is_no_obstacle(tmp_path: Path) -> None:
    keeps(ENDS_WITHIN_S, "s from signal to end", partial(closed_while_connecting_s, tmp_path))


def closed_while_connecting_s(tmp_path: Path) -> float:
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        deaf.settimeout(30)
        with opened(f"127.0.0.1:{deaf.getsockname()[1]}", tmp_path) as process:
            connection, _ = deaf.accept()
            with connection:
                signalled_s = time.monotonic()
                process.terminate()
                assert process.wait(20) == 0
                return time.monotonic() - signalled_s
