"""robotctl watch and its keys, typed on a real terminal."""

import signal
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import preview_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.gateway_program import gateway_program
from tests.support.preview_double import double_process
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL
from tests.support.terminal import Terminal, robotctl_on_terminal, terminal_with
from tests.support.waiting import wait_until

CTRL_C, CTRL_Z, CTRL_BACKSLASH = "\x03", "\x1a", "\x1c"
SHOW_CURSOR, HIDE_CURSOR = "\x1b[?25h", "\x1b[?25l"


@pytest.fixture
def screen(target: str) -> Iterator[Terminal]:
    with robotctl_on_terminal("watch", "--interval", "0.1", "--target", target) as screen:
        screen.wait_to_see("q quit")
        yield screen


def left_in_order(screen: Terminal, code: int = 0) -> None:
    """It ended, and the terminal is in its old mode."""
    assert screen.process.wait(ENDS_WITHIN_S) == code
    assert screen.manners() == screen.manners_before
    drawn = screen.read()
    assert drawn.rindex(SHOW_CURSOR) > drawn.rindex(HIDE_CURSOR)
    assert "Traceback" not in drawn


def test_the_keys_switch_the_preview_of_a_real_gateway(tmp_path: Path) -> None:
    with (
        double_process(tmp_path / "preview.sock"),
        gateway_program(tmp_path, sources=[]) as gateway,
        robotctl_on_terminal("watch", "--interval", "0.2", "--target", f"127.0.0.1:{gateway.port}") as screen,
    ):
        screen.wait_to_see("p preview on")
        screen.press("p")
        screen.wait_to_see("p preview off")
        screen.wait_to_see("RUNNING")
        assert gateway.status().preview.state == states.PREVIEW_RUNNING
        for key, words, profile in (
            ("1", "[low-bw]", preview_pb2.PREVIEW_PROFILE_LOW_BW),
            ("3", "[high-quality]", preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY),
            ("2", "[balanced]", preview_pb2.PREVIEW_PROFILE_BALANCED),
        ):
            screen.press(key)
            screen.wait_to_see(f"{key} {words}")
            assert gateway.status().preview.profile == profile
        screen.press("p")
        screen.wait_to_see("p preview on")
        assert gateway.status().preview.state == states.PREVIEW_DISABLED
        screen.press("q")
        left_in_order(screen)


def test_a_profile_chosen_while_it_is_off_is_for_the_next_start(
    screen: Terminal, double: GatewayDouble
) -> None:
    screen.press("3")
    screen.wait_to_see("high-quality: p turns the preview on with it")
    assert not double.preview_requests
    screen.press("p")
    screen.wait_to_see("RUNNING")
    assert double.preview_requests[0].profile == preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY


def test_a_refusal_is_shown_in_place(screen: Terminal, double: GatewayDouble) -> None:
    double.accept = False
    screen.press("p")
    screen.wait_to_see("the robot refused: the robot is being serviced")
    shown = screen.lines()
    assert sum("robot healthy" in line for line in shown) == 1, "the table stands, once"
    assert any("q quit" in line for line in shown)
    screen.press("q")
    left_in_order(screen)


class OnlyLook(GatewayDouble):
    """Refuses every preview request."""

    def SetPreviewMode(self, _request: Any, context: Any) -> Any:  # noqa: N802  # the contract's name
        context.abort(grpc.StatusCode.PERMISSION_DENIED, "viewers only watch")


def test_a_failed_request_is_shown_in_place() -> None:
    with (
        serving(OnlyLook()) as port,
        robotctl_on_terminal("watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}") as screen,
    ):
        screen.wait_to_see("q quit")
        screen.press("p")
        screen.wait_to_see("viewers only watch")
        screen.press("q")
        left_in_order(screen)


class Slow(GatewayDouble):
    """Answers a preview request late."""

    def __init__(self) -> None:
        super().__init__()
        self.asked, self.go_on = threading.Event(), threading.Event()

    def SetPreviewMode(self, request: Any, context: Any) -> Any:  # noqa: N802  # the contract's name
        self.asked.set()
        self.go_on.wait(60)
        return super().SetPreviewMode(request, context)


def test_a_key_never_holds_up_the_redraw_nor_the_next_key() -> None:
    slow = Slow()
    with (
        serving(slow) as port,
        robotctl_on_terminal("watch", "--interval", "0.1", "--target", f"127.0.0.1:{port}") as screen,
    ):
        try:
            screen.wait_to_see("q quit")
            screen.press("p")
            screen.wait_to_see("preview on: request sent ...")
            assert slow.asked.wait(10)
            slow.status.health.measured_vx_mps = slow.status.health.linear_speed_mps = 1.25
            screen.wait_to_see("1.25 m/s")
            screen.press("p12")
            screen.wait_to_see("request sent ...")
            screen.press("q")
            left_in_order(screen)
            assert not slow.preview_requests, "it did not wait for the answer"
        finally:
            slow.go_on.set()


@pytest.mark.parametrize("way", ["q", CTRL_C, CTRL_BACKSLASH, "SIGTERM", "SIGHUP"], ids=repr)
def test_every_way_out_leaves_the_terminal_as_it_was(screen: Terminal, way: str) -> None:
    wait_until(screen.key_by_key, "keys are read one by one")
    if way.startswith("SIG"):
        screen.process.send_signal(signal.Signals[way])
    else:
        screen.press(way)
    left_in_order(screen)
    assert not any("q quit" in line for line in screen.lines()), "what stays offers no keys"
    assert any("robot healthy" in line for line in screen.lines()), "the last table stays"


def test_an_error_on_the_way_leaves_the_terminal_as_it_was(screen: Terminal, double: GatewayDouble) -> None:
    double.failures.append((grpc.StatusCode.INTERNAL, "out of order"))
    left_in_order(screen, code=1)
    screen.wait_to_see("error: the call to the robot gateway")


def test_a_terminal_that_is_pulled_away_ends_it(screen: Terminal) -> None:
    screen.pull_away()
    # 1 when it was just drawing: the output can't be written.
    assert screen.process.wait(ENDS_WITHIN_S) in (0, 1)


def test_it_is_suspended_and_continued_as_a_shell_does_it(target: str, double: GatewayDouble) -> None:
    """A real shell, without an editor of its own, which would change the terminal's mode as well."""
    shell = ["bash", "--norc", "--noprofile", "--noediting", "-i"]
    with terminal_with(shell, extra={"PS1": "$ "}) as screen:
        screen.wait_for("$ ")
        manners = screen.manners()
        screen.press(f"{ROBOTCTL} watch --interval 0.1 --target {target}\n")
        screen.wait_for("high-quality")

        def called_since(calls: int) -> bool:
            return len(double.calls) > calls

        for _ in range(2):
            wait_until(screen.key_by_key, "keys are read one by one")
            place = screen.wait_for("robot healthy", after=len(screen.drawn))
            screen.press(CTRL_Z)
            place = screen.wait_for("Stopped", after=place)
            assert screen.manners() == manners, "the shell has its terminal"
            assert screen.drawn.rindex(SHOW_CURSOR) > screen.drawn.rindex(HIDE_CURSOR)
            screen.press("echo a shell again\n")
            place = screen.wait_for("a shell again\r\n", after=place)
            calls = len(double.calls)
            screen.press("fg\n")
            screen.wait_for("high-quality", after=place)
            wait_until(partial(called_since, calls), "it polls again")
        wait_until(screen.key_by_key, "keys are read one by one")
        screen.press("p")
        wait_until(lambda: double.preview_requests, "keys do something again")
        screen.press("q")
        wait_until(lambda: screen.manners() == manners, "the terminal is as it was")
        screen.press("echo ended $?\n")
        screen.wait_for("ended 0")


def test_in_the_background_it_leaves_the_keyboard_to_the_shell(target: str) -> None:
    shell = ["bash", "--norc", "--noprofile", "--noediting", "-i"]
    with terminal_with(shell, extra={"PS1": "$ "}) as screen:
        screen.wait_for("$ ")
        screen.press(
            f"{ROBOTCTL} watch --count 3 --interval 0.1 --target {target} & wait $!; echo ended $?\n"
        )
        screen.wait_for("ended 0")


def test_without_a_keyboard_it_says_how_it_ends(target: str) -> None:
    with robotctl_on_terminal("watch", "--target", target, typing=False) as screen:
        screen.wait_to_see("Ctrl-C ends")
        assert not any("q quit" in line for line in screen.lines())
        screen.process.send_signal(signal.SIGINT)
        assert screen.process.wait(ENDS_WITHIN_S) == 0


def test_on_a_small_terminal_the_keys_stay_in_sight(target: str) -> None:
    with robotctl_on_terminal("watch", "--interval", "0.1", "--target", target, rows=9) as screen:
        screen.wait_to_see("q quit")
        shown = screen.lines()
        assert any("more line" in line and "make the window taller" in line for line in shown)
        assert len([line for line in shown if line]) <= 9
        screen.resize(40, 100)
        wait_until(lambda: "battery" in screen.read()[-4000:], "there is room for all")


def test_arrows_and_function_keys_mean_nothing(screen: Terminal, double: GatewayDouble) -> None:
    screen.press("\x1b[A\x1b[1~\x1bOP\x1b[1;5C")
    screen.press("3")
    screen.wait_to_see("high-quality: p turns the preview on with it")
    assert not double.preview_requests
