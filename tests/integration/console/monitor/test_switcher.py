"""Switching to a robot that announces itself: all the way from its gateway to the menu of `robotctl monitor`.

On this machine's loopback interface alone.
"""

import threading
import time
from collections.abc import Callable, Generator, Iterator
from io import StringIO
from pathlib import Path
from typing import Any, TypeAlias

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QApplication
from rich.console import Console
from zeroconf import ServiceInfo, Zeroconf

from common.advertisement import SERVICE_TYPE
from console.cli.session import Session
from console.cli.windows import open_monitor
from console.robots.robots_file import Robot
from console.window import programs
from console.window.monitor_window import MonitorWindow
from tests.support.cockpit import resting_robot
from tests.support.gateway_program import gateway_program
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst

Condition: TypeAlias = Callable[[], Any]
LOOPBACK = "127.0.0.1"
ANNOUNCED_WITHIN_S = 60.0
"""On a machine that does other things as well; unloaded it takes 2 s."""


@pytest.fixture
def loopback_only(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("ROBOTCTL_DISCOVERY", LOOPBACK)
    yield
    wait_until(
        lambda: "robot-search" not in {each.name for each in threading.enumerate()}, "no search is left"
    )


@pytest.fixture
def safe_robot() -> Iterator[str]:
    """One that announces that it requires a login; its target."""
    zeroconf = Zeroconf(interfaces=[LOOPBACK])
    zeroconf.register_service(
        ServiceInfo(
            SERVICE_TYPE,
            f"safe.{SERVICE_TYPE}",
            port=50999,
            properties={"name": b"Safe One", "tls": b"1"},
            server="safe.local.",
            parsed_addresses=[LOOPBACK],
        )
    )
    yield f"{LOOPBACK}:50999"
    zeroconf.close()


class Person:
    """In front of the windows: waits for each condition that `acts` yields, goes on, and closes them.

    A nested event loop would keep the program from opening its next window.
    """

    def __init__(self, acts: Generator[Condition, Any]) -> None:
        self._acts = acts
        self._waits_for = next(acts)
        self._ends_s = time.monotonic() + 2 * ANNOUNCED_WITHIN_S
        self._acting = False
        """Also after a step that has failed; Qt has printed why."""
        self.content = False
        """Whether every step was taken."""

    def look(self) -> None:
        """Is called again and again."""
        seen = None if self._acting else self._waits_for()
        if seen:
            self._acting = True
            try:
                self._waits_for = self._acts.send(seen)
                self._acting = False
            except StopIteration:
                self.content = True
        if self._acting or time.monotonic() > self._ends_s:
            for window in windows():
                window.close()


def in_the_window(
    application: QApplication, monkeypatch: pytest.MonkeyPatch, target: str, acts: Generator[Condition, Any]
) -> None:
    """Runs `robotctl monitor` for a robot, with a person in front of it."""

    class Ours:
        def __enter__(self) -> QApplication:
            application.setQuitOnLastWindowClosed(True)
            return application

        def __exit__(self, *_error: object) -> None:
            application.setQuitOnLastWindowClosed(False)

    person = Person(acts)
    monkeypatch.setattr(programs, "application", lambda _title: Ours())
    timer = QTimer(application, interval=50)
    timer.timeout.connect(person.look)
    timer.start()
    open_monitor(lambda: Session(Robot(target=target), False, Console(file=StringIO())))
    timer.stop()
    assert person.content


def windows() -> list[MonitorWindow]:
    return [
        each
        for each in QApplication.topLevelWidgets()
        if isinstance(each, MonitorWindow) and each.isVisible()
    ]


def entry(window: MonitorWindow, words: str) -> QAction | None:
    return next((each for each in window.header.name.robots.actions() if words in each.text()), None)


def trigger(window: MonitorWindow, words: str) -> None:
    """Chooses an entry; the list may have been filled anew since it was seen."""
    chosen = entry(window, words)
    assert chosen
    window.header.name.robots.hide()
    chosen.trigger()


@pytest.mark.usefixtures("loopback_only")
def test_a_gateway_that_announces_itself_is_found_and_opened(
    application: QApplication, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcing = {"advertise": True, "addresses": [LOOPBACK]}
    with (
        resting_robot() as robot,
        gateway_program(tmp_path, name="lab & 7", sources=[], discovery=announcing) as gateway,
    ):
        target = f"{LOOPBACK}:{gateway.port}"

        def connected() -> bool:
            return any(
                each.header.target.text() == target and each.header.link.word.text().startswith("connected")
                for each in windows()
            )

        def act() -> Generator[Condition, Any]:
            (window,) = yield windows
            window.header.name.robots.popup(window.pos())
            assert entry(window, "Searching the network ...")
            yield lambda: entry(window, f"lab && 7  ({target}, found on the network)")
            trigger(window, target)
            yield connected

        in_the_window(application, monkeypatch, robot.target, act())


@pytest.mark.usefixtures("loopback_only")
def test_one_that_needs_a_login_is_not_opened_without_but_says_how_to_get_one(
    application: QApplication, safe_robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def act() -> Generator[Condition, Any]:
        (window,) = yield windows
        window.header.name.robots.popup(window.pos())
        yield lambda: entry(window, "found on the network, needs a login")
        trigger(window, "needs a login")
        (note,) = yield lambda: window.toasts.notes
        assert note.text.endswith(f"type: robotctl login safe-one {safe_robot} FILE")
        assert windows() == [window]

    with resting_robot() as robot:
        in_the_window(application, monkeypatch, robot.target, act())
