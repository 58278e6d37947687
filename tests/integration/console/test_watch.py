"""robotctl watch, on a terminal and in a pipe, while the robot comes and goes."""

import json
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO

import pytest

from omniseer.gateway.v1 import states_pb2 as states
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment
from tests.support.terminal import robotctl_on_terminal, seen
from tests.support.waiting import wait_until

SHOW_CURSOR, HIDE_CURSOR = "\x1b[?25h", "\x1b[?25l"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class Lines:
    """robotctl in a pipe; its lines as they come."""

    def __init__(self, *words: str) -> None:
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            [ROBOTCTL, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()
        )
        assert self.process.stdout
        self._reader = threading.Thread(target=self._read, args=(self.process.stdout,))
        self._reader.start()

    def _read(self, stdout: IO[str]) -> None:
        for line in stdout:
            self.lines.append(line)

    def wait_for(self, text: str) -> str:
        """Waits for a line with this text."""
        return wait_until(
            lambda: next((line for line in self.lines if text in line), None), f"a line with {text!r}", 30
        )

    def close(self) -> str:
        """Ends it if it still runs; what it said on standard error."""
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stderr
        assert self.process.stdout
        with self.process.stderr as errors, self.process.stdout:
            return errors.read()


@contextmanager
def lines(*words: str) -> Iterator[Lines]:
    watching = Lines(*words)
    try:
        yield watching
    finally:
        watching.close()


def test_a_terminal_is_redrawn_in_place(double: GatewayDouble) -> None:
    with (
        serving(double) as port,
        robotctl_on_terminal("watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}") as screen,
    ):
        screen.wait_for("robot healthy")
        double.status.health.measured_vx_mps = double.status.health.linear_speed_mps = 1.25
        screen.wait_for("1.25 m/s")
        shown = seen(screen.read())
        assert sum("robot healthy" in line for line in shown) == 1, "one table, the newest"
        assert not any("0.50 m/s" in line for line in shown)
        assert COLOUR.search(screen.drawn)
        assert screen.drawn.startswith(HIDE_CURSOR)


@pytest.mark.parametrize("how", ["ctrl-c", "SIGTERM"])
def test_it_ends_0_and_leaves_the_terminal_as_it_was(double: GatewayDouble, how: str) -> None:
    with serving(double) as port, robotctl_on_terminal("watch", "--target", f"127.0.0.1:{port}") as screen:
        screen.wait_for("robot healthy")
        if how == "ctrl-c":
            screen.press("\x03")
        else:
            screen.process.send_signal(signal.SIGTERM)
        assert screen.process.wait(ENDS_WITHIN_S) == 0
        drawn = screen.read()
        assert drawn.rindex(SHOW_CURSOR) > drawn.rindex(HIDE_CURSOR)
        assert "Traceback" not in drawn


def test_no_color_is_respected_on_a_terminal(double: GatewayDouble) -> None:
    with (
        serving(double) as port,
        robotctl_on_terminal(
            "watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}", extra={"NO_COLOR": "1"}
        ) as screen,
    ):
        double.status.vision.stale, double.status.vision.age_ms = True, 3400
        screen.wait_for("STALE")
        screen.wait_for("3.4 s")
        # Bold and dim are left, colours (30-37, 90-97, 38;...) are not.
        codes = {code for found in COLOUR.findall(screen.drawn) for code in found[2:-1].split(";")}
        assert codes <= {"", "0", "1", "2"}


def test_an_outage_is_shown_with_the_age_of_the_values(double: GatewayDouble) -> None:
    with (
        serving(double) as port,
        robotctl_on_terminal("watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}") as screen,
    ):
        screen.wait_for("robot healthy")
        double.hold.clear()
        screen.wait_for("NO ANSWER, the values below are")
        double.hold.set()
        wait_until(lambda: not any("NO ANSWER" in line for line in screen.lines()), "the robot is back", 30)


def test_a_pipe_gets_one_line_per_update(double: GatewayDouble) -> None:
    with serving(double) as port:
        watching = Lines("watch", "--count", "3", "--interval", "0.1", "--target", f"127.0.0.1:{port}")
        assert watching.process.wait(ENDS_WITHIN_S) == 0
        assert watching.close() == ""
    assert len(watching.lines) == 3
    for line in watching.lines:
        assert re.fullmatch(
            r"\d\d:\d\d:\d\d \S+  health ok \(robot healthy\)  motion 0\.50 m/s .*\n", line
        ), line
        assert "\x1b" not in line


def test_a_pipe_gets_one_document_per_line(double: GatewayDouble) -> None:
    with serving(double) as port:
        watching = Lines(
            "watch", "--json", "--count", "2", "--interval", "0.1", "--target", f"127.0.0.1:{port}"
        )
        assert watching.process.wait(ENDS_WITHIN_S) == 0
        assert watching.close() == ""
    documents = [json.loads(line) for line in watching.lines]
    assert len(documents) == 2
    for document in documents:
        assert set(document) == {"at", "status", "error"}
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}\+00:00", document["at"])
        assert document["status"]["health"]["state"] == "ok"
        assert document["error"] is None


def test_a_gateway_that_restarts_is_followed(double: GatewayDouble) -> None:
    with serving(double) as port:
        watching = Lines("watch", "--json", "--interval", "0.1", "--target", f"127.0.0.1:{port}")
        try:
            watching.wait_for('"error": null')
        except AssertionError:
            watching.close()
            raise
    try:
        gone = json.loads(watching.wait_for('"status": null'))
        assert gone["error"]["kind"] == "unreachable"
        assert gone["error"]["exit_code"] == 3
        seen = len(watching.lines)
        double.status.health.state = states.ROBOT_HEALTH_DEGRADED
        with serving(double, port):
            wait_until(
                lambda: any("degraded" in line for line in watching.lines[seen:]), "it is seen again", 30
            )
            watching.process.send_signal(signal.SIGINT)
            assert watching.process.wait(ENDS_WITHIN_S) == 0
    finally:
        assert watching.close() == ""


def test_updates_keep_their_interval(double: GatewayDouble) -> None:
    """Twenty updates at 0.1 s take two seconds, not two and twenty answers; slower only on a busy machine."""
    with (
        serving(double) as port,
        lines("watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}") as watching,
    ):
        watching.wait_for("health ok")
        began_s, first = time.monotonic(), len(double.calls)
        wait_until(lambda: len(double.calls) >= first + 20, "twenty more updates", 60)
        assert time.monotonic() - began_s > 1.5, "it never polls faster than the interval"
