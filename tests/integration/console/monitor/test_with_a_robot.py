"""The window with a whole robot behind it: real messages, real gateway, real video; each of them fails.

Screenshots of every situation are kept in artifacts/monitor; docs/images has those that were taken with
SCREENSHOTS_FOR_DOCUMENTS=1.
"""

import os
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import psutil
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest

from bench.loop_delay import LoopDelay
from console.monitor.history import METRICS
from console.window.fault_line import FaultLine
from console.window.lines import StatusLine
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from tests.support.promise import MS, keeps
from tests.support.qt import keep_screenshot, let_pass, pixel_rows, press, until
from tests.support.whole_robot import WholeRobot, whole_robot

pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timeout(240)]

LOOP_DELAY_P99_MS = 30.0
CLOSES_WITHIN_S = 2.0
WINDOW = (1280, 800)


@dataclass
class Watch:
    """A person in front of the window."""

    robot: WholeRobot
    window: MonitorWindow

    def line(self, name: str) -> StatusLine:
        """The line of a component."""
        for line in self.window.side.components.shown:
            if line.label.text() == name:
                return line
        raise LookupError(name)

    def plotted(self, title: str) -> str:
        """The newest value of a plot, as it is written."""
        index = [metric.title for metric in METRICS].index(title)
        return str(self.window.plots.all[index].value_text)

    def mark_is(self, name: str, mark: str) -> None:
        until(lambda: name in self.names() and self.line(name).mark.text() == mark, f"{name} is {mark}")

    def names(self) -> list[str]:
        return [line.label.text() for line in self.window.side.components.shown]

    def faults(self) -> list[FaultLine]:
        return list(self.window.side.faults.shown)

    def fault_says(self, words: str) -> FaultLine:
        return until(lambda: next((f for f in self.faults() if words in f.text.text()), None), words)

    def health_is(self, word: str) -> None:
        until(lambda: self.window.header.health.word.text() == word, f"health is {word}")

    def link_is(self, word: str) -> None:
        until(lambda: self.window.header.link.word.text() == word, f"the connection is {word}")

    def preview_is(self, word: str) -> None:
        until(lambda: self.window.preview.state.word.text() == word, f"the preview is {word}")

    def video_moves(self) -> None:
        """Frames are painted, one after the other."""
        painted = 0

        def count() -> None:
            nonlocal painted
            painted += 1

        connection = self.window.video.painted.connect(count)
        until(lambda: painted >= 15, "15 frames are painted")
        self.window.video.painted.disconnect(connection)

    def key(self, key: Qt.Key) -> None:
        until(self.window.preview.switch.isEnabled, "the controls may be touched")
        press(self.window, key)


@pytest.fixture
def watch(ros_domain: int, tmp_path: Path) -> Iterator[Watch]:  # noqa: ARG001  # for its effect
    with whole_robot(tmp_path) as robot, monitor(robot.target) as window:
        window.showNormal()
        window.resize(*WINDOW)
        made = Watch(robot, window)
        made.health_is("OK")
        yield made


def yellow_pixels(image: QImage) -> int:
    """Pixels in the colour of the boxes, one in four looked at."""
    count = 0
    for row in islice(pixel_rows(image), None, None, 2):
        for red, green, blue in islice(row, None, None, 2):
            count += red > 200 and 180 < green < 240 and 30 < blue < 110
    return count


def test_a_day_at_the_window(watch: Watch) -> None:
    for name in ("Motion", "Vision", "Objects", "Battery", "Command"):
        watch.mark_is(name, "fresh")
    until(lambda: watch.plotted("CPU load") != "no data", "the load of the computer is plotted")
    keep_screenshot(watch.window, "healthy")

    watch.key(Qt.Key.Key_P)
    watch.preview_is("RUNNING")
    watch.video_moves()
    boxes_are_drawn(watch)
    until(lambda: watch.plotted("Video rate").endswith(" fps"), "the video's rate is plotted")
    keep_screenshot(watch.window, "preview-running", fills_in_s=8)

    watch.robot.sensors.change(silent=["odometry"])
    watch.mark_is("Motion", "STALE")
    watch.health_is("DEGRADED")
    assert watch.fault_says("odometry").remedy.text()
    watch.mark_is("Vision", "fresh")
    keep_screenshot(watch.window, "stale-odometry")
    watch.robot.sensors.change(silent=[])
    watch.mark_is("Motion", "fresh")

    watch.robot.kill_preview()
    watch.preview_is("FAULTED")
    watch.fault_says("preview service")
    reason = watch.window.side.notes.shown[0]
    until(reason.text.text, "the reason is shown")
    watch.mark_is("Video", "STALE")
    keep_screenshot(watch.window, "preview-faulted")
    watch.robot.preview.start_again()
    watch.preview_is("RUNNING")
    watch.video_moves()

    until(
        lambda: all(fault.mark.text() in ("cleared", "none") for fault in watch.faults()), "nothing is wrong"
    )

    watch.robot.gateway.kill()
    watch.link_is("unreachable")
    assert watch.window.banner.isVisible()
    assert not watch.window.preview.switch.isEnabled()
    watch.mark_is("Motion", "STALE")
    watch.video_moves()  # the stream does not need the gateway
    keep_screenshot(watch.window, "unreachable", fills_in_s=3)

    watch.robot.start_gateway()
    QTest.mouseClick(watch.window.banner.button, Qt.MouseButton.LeftButton)
    watch.link_is("connected")
    watch.mark_is("Motion", "fresh")
    watch.health_is("OK")
    assert not watch.window.banner.isVisible()
    until(
        lambda: any("restarted" in line for line in watch.window.side.events.lines),
        "the restart is an event",
    )
    watch.video_moves()
    keep_screenshot(watch.window, "reconnected", fills_in_s=2)


def boxes_are_drawn(watch: Watch) -> None:
    """With the overlay there is more of the boxes' colour than without it."""

    def more_with_it() -> bool:
        watch.window.video.show_overlay(True)
        with_boxes = yellow_pixels(watch.window.video.grab().toImage())
        watch.window.video.show_overlay(False)
        without = yellow_pixels(watch.window.video.grab().toImage())
        watch.window.video.show_overlay(True)
        return with_boxes > without + 40

    until(more_with_it, "boxes are drawn")


@pytest.mark.timed
def test_the_window_answers_while_video_plays_and_closes_at_once(watch: Watch) -> None:
    yield_to_the_window()
    watch.key(Qt.Key.Key_P)
    watch.preview_is("RUNNING")
    watch.video_moves()
    keeps(
        LOOP_DELAY_P99_MS,
        "ms of loop delay, 99th percentile",
        partial(loop_delay_p99_ms, watch.window),
        per_stalled_s=MS,
    )
    # Everything hangs, and closing does not wait for it.
    watch.robot.gateway.kill()
    closed_s = time.monotonic()
    press(watch.window, Qt.Key.Key_Q)
    until(lambda: not watch.window.isVisible(), "it is closed", CLOSES_WITHIN_S)
    assert time.monotonic() - closed_s < CLOSES_WITHIN_S


def yield_to_the_window() -> None:
    """The robot is another machine: here it must not take the processors that the window needs."""
    for program in psutil.Process().children(recursive=True):
        # Those that it will start as well; a nice value is that of a thread, not of a process (sched(7)).
        for thread in program.threads():
            os.setpriority(os.PRIO_PROCESS, thread.id, 10)


def loop_delay_p99_ms(window: MonitorWindow) -> float:
    delay = LoopDelay()
    painted: list[float] = []
    connection = window.video.painted.connect(lambda: painted.append(time.monotonic()))
    delay.start()
    let_pass(5)
    delays_ms = delay.stop()
    window.video.painted.disconnect(connection)
    assert len(painted) > 60, "real video"
    return statistics.quantiles(delays_ms, n=100)[98]


def test_the_ruler_sees_a_loop_that_is_held_up() -> None:
    delay = LoopDelay()
    delay.start()
    let_pass(0.05)
    time.sleep(0.2)
    let_pass(0.05)
    found = delay.stop()
    assert max(found) > 150
    assert sum(wait > 100 for wait in found) > 10, "all that fell due meanwhile counts"
