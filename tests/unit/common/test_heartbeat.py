"""What a supervisor hears by sd_notify: from `Heartbeats` alone, and from a whole program."""

import errno
import logging
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from common.heartbeat import Heartbeats

PROGRAM = """
from common import heartbeat, program
async def main(stop):
    heartbeat.own().ready()
    await stop.wait()
program.run(main)
"""


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.settimeout(10)
        listener.bind(str(tmp_path / "notify"))
        yield listener


@pytest.fixture
def environment(supervisor: socket.socket, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setenv("NOTIFY_SOCKET", supervisor.getsockname())
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    monkeypatch.delenv("WATCHDOG_PID", raising=False)
    return monkeypatch


def heard(supervisor: socket.socket) -> list[bytes]:
    supervisor.setblocking(False)
    messages = []
    while True:
        try:
            messages.append(supervisor.recv(64))
        except BlockingIOError:
            return messages


@pytest.mark.usefixtures("environment")
def test_it_says_when_it_serves_lives_and_ends(supervisor: socket.socket) -> None:
    heartbeats = Heartbeats()
    assert heartbeats.interval_s == 5
    heartbeats.ready()
    heartbeats.send()
    heartbeats.send()  # not due
    heartbeats.stopping()
    assert heard(supervisor) == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
    assert not {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"} & os.environ.keys()


@pytest.mark.usefixtures("environment")
def test_without_a_descriptor_a_heartbeat_is_missed_and_the_program_goes_on(
    supervisor: socket.socket, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refused(*_: Any) -> socket.socket:
        raise OSError(errno.EMFILE, "Too many open files")

    heartbeats = Heartbeats()
    with monkeypatch.context() as without, caplog.at_level(logging.WARNING):
        without.setattr(socket, "socket", refused)
        heartbeats.send()
    assert "WATCHDOG=1 did not reach the supervisor" in caplog.text
    heartbeats.ready()
    assert heard(supervisor) == [b"READY=1"]


@pytest.mark.parametrize(
    ("variable", "value"),
    [("WATCHDOG_USEC", ""), ("WATCHDOG_USEC", "-1"), ("WATCHDOG_USEC", "²"), ("WATCHDOG_PID", "1")],
)
def test_without_a_watchdog_of_this_process_it_sends_no_heartbeats(
    environment: pytest.MonkeyPatch, supervisor: socket.socket, variable: str, value: str
) -> None:
    environment.setenv(variable, value)
    heartbeats = Heartbeats()
    assert heartbeats.interval_s == 0
    heartbeats.send()
    heartbeats.ready()
    assert heard(supervisor) == [b"READY=1"]


def test_the_watchdog_of_this_very_process_counts(environment: pytest.MonkeyPatch) -> None:
    environment.setenv("WATCHDOG_PID", str(os.getpid()))
    assert Heartbeats().interval_s == 5


def test_without_a_supervisor_it_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    heartbeats = Heartbeats()
    assert heartbeats.interval_s == 0
    for say in (heartbeats.ready, heartbeats.send, heartbeats.stopping):
        say()


@pytest.mark.usefixtures("environment")
def test_a_supervisor_that_has_gone_is_a_warning(
    supervisor: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    supervisor.close()
    Heartbeats().ready()
    assert "READY=1 did not reach the supervisor" in caplog.text


@pytest.mark.usefixtures("environment")
def test_none_is_sent_while_something_hangs(
    supervisor: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    heartbeats = Heartbeats()
    heartbeats.withheld = "ROS has not been read for 31 s"
    with caplog.at_level(logging.ERROR):
        heartbeats.send()
    assert heard(supervisor) == []
    assert "started again: ROS has not been read for 31 s" in caplog.text


def test_a_program_says_that_it_serves_and_that_it_ends(supervisor: socket.socket) -> None:
    environment = os.environ | {"NOTIFY_SOCKET": supervisor.getsockname(), "WATCHDOG_USEC": "60000000"}
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], env=environment, cwd=Path(__file__).parents[3]
    ) as program:
        assert {supervisor.recv(64), supervisor.recv(64)} == {b"READY=1", b"WATCHDOG=1"}
        program.send_signal(signal.SIGTERM)
        assert supervisor.recv(64) == b"STOPPING=1"
        assert program.wait(10) == 0
