"""Driving in the cockpit: what its buttons and keys do, and what it shows."""

import time

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from console.client import StopLatch, Supervision
from console.client.results import Teleop, TeleopState
from console.monitor.driver import DriverView
from console.monitor.monitor_state import MonitorState
from console.monitor.worker import Worker
from console.presentation.drive_display import DriveDisplay, own_display, watched_display
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.window.bottom_strip import BottomStrip
from console.window.drive_hands import TICK_MS, DriveHands, Pad
from console.window.picture_area import PictureArea

_TICKS_PER_DRAWING = 100 // TICK_MS


class Driving(QObject):
    """Connects the hands, the driver, the place of STOP and the head-up display.

    Args:
        window: the cockpit.
        worker: talks to the gateway; none of its calls here blocks.
        strip: has the buttons.
        picture: has the head-up display, and room for the answers.
        pad: a gamepad; None without one.
    """

    def __init__(
        self,
        window: QWidget,
        worker: Worker,
        strip: BottomStrip,
        picture: PictureArea,
        pad: Pad | None = None,
    ) -> None:
        super().__init__(window)
        self._worker, self._driver = worker, worker.driver
        self._strip, self._picture = strip, picture
        self.hands = DriveHands(window, worker.driver, strip.driving.stop_place, pad)
        self._ticks = 0
        self._pad_problem = ""
        """The one that was shown last."""
        place = strip.driving
        self.hands.stopped.connect(self.stop)
        self.hands.ticked.connect(self._tick)
        place.stop_pressed.connect(self.stop)
        place.drive_pressed.connect(self.toggle)
        place.begin_chosen.connect(self.begin)
        place.reset_pressed.connect(self._driver.reset)
        place.enabled_chosen.connect(self._driver.set_enabled)

    def show_state(self, state: MonitorState) -> None:
        """Shows the latest state. What was known of driving stays while the robot does not answer."""
        for note in self._driver.take_notes():
            self._picture.toasts.show_passing(note)
        if state.snapshot:
            teleop, view = state.snapshot.status.teleop, self._driver.view()
            self.hands.driveable = teleop.state is not TeleopState.UNKNOWN
            known = not state.outdated(time.monotonic())
            display = _display(teleop, view, known=known)
            if self.hands.pad:
                self._show_pad(self.hands.pad)
            self._strip.show_teleop(teleop, view, _latch(display), known=known)
            self._picture.show_driving(display)

    # Actions of the keys and buttons.

    def stop(self) -> None:
        """Stops the robot, whether this window drives it or not."""
        self.hands.release()
        if self.hands.driveable:
            self._driver.stop("by STOP in the monitor")

    def toggle(self) -> None:
        """Begins driving by the picture, or ends driving."""
        if self._driver.view().open:
            self.hands.release()
            self._driver.end()
        else:
            self.begin(Supervision.PICTURE, False)

    def begin(self, supervision: Supervision, take_over: bool) -> None:
        """Begins driving. What is held already counts only when it is pressed anew."""
        self.hands.release()
        if self.hands.driveable:
            self._driver.begin(supervision, take_over=take_over)

    def reset(self) -> None:
        """Resets the stop that is shown."""
        self._strip.driving.press_reset()

    def close(self) -> None:
        """Releases, and ends driving."""
        self.hands.close()
        self._driver.end()

    def _show_pad(self, pad: Pad) -> None:
        self._strip.driving.show_pad(pad.description())
        problem = pad.problem()
        if problem and problem != self._pad_problem:
            self._picture.toasts.show_passing(Note(f"Not driving: {problem}", SeverityStyle.WARNING))
        self._pad_problem = problem

    def _tick(self) -> None:
        """Draws more often than the status comes, while this window drives."""
        self._ticks += 1
        if self._ticks % _TICKS_PER_DRAWING == 0 and self._driver.view().open:
            self.show_state(self._worker.latest())


def _display(teleop: Teleop, view: DriverView, *, known: bool) -> DriveDisplay | None:
    if view.supervision is None or view.state is None or view.limits is None:
        return watched_display(teleop, known=known)
    return own_display(
        view.state, view.limits, view.supervision, state_age_s=view.state_age_s, ready=view.ready
    )


def _latch(display: DriveDisplay | None) -> StopLatch | None:
    return display.stop if display else None
