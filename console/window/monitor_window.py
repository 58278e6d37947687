"""The cockpit: one robot, its picture first, with everything that an operator looks at."""

import time
from collections.abc import Callable  # noqa: TC003  # read by the type checker alone
from functools import partial
from pathlib import Path
from typing import Final

from PySide6.QtCore import QTimer
from PySide6.QtGui import QCloseEvent, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QVBoxLayout, QWidget

from console.monitor.alarm import LOST_LINK, Alarm, Occurrence
from console.monitor.history import History, values_of
from console.monitor.link import is_alarming, link_text
from console.monitor.monitor_state import MonitorState, PreviewRequest
from console.monitor.motion import Motion, motion
from console.monitor.status_rows import FaultItem
from console.monitor.trail import Trail
from console.monitor.value_tiles import tile_items
from console.monitor.worker import Worker
from console.presentation.own_stream import OwnStream  # noqa: TC001  # read by the type checker alone
from console.presentation.picture_age import PictureAge  # noqa: TC001  # the same
from console.presentation.preview_switch import Note
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle
from console.robots.roster import RobotChoice, Roster
from console.viewer.playback import PlaybackState
from console.window import window_settings
from console.window.alarm_sound import AlarmSound
from console.window.arrangement import Arrangement, Parts
from console.window.bottom_strip import BottomStrip
from console.window.cockpit_keys import KEYS_OF_THE_HANDS, cockpit_keys
from console.window.drive_hands import Pad
from console.window.driving import Driving
from console.window.handover import ThreadHandover
from console.window.keys import bind_keys, leave_full_screen
from console.window.layout import fill
from console.window.picture_area import PictureArea
from console.window.plot import Plots
from console.window.practice_band import PracticeBand
from console.window.preview_actions import PreviewActions
from console.window.recording_actions import RecordingActions
from console.window.saver import Saver
from console.window.side_panel import TABS, SidePanel
from console.window.theme import COCKPIT
from console.window.top_bar import TopBar
from console.window.video_view import VideoView
from console.window.window_settings import Choices

_TICK_MS: Final = 400
"""Shorter than a slot of the plots, so that a late tick leaves no gap in a curve."""
_SAVES_END_WITHIN_S: Final = 1.0


class MonitorWindow(QWidget):
    """Shows the latest state after each change, and at every tick besides: ages grow by themselves.

    Args:
        worker: talks to the gateway; none of its calls here blocks.
        changes: signals changes of the worker's state; the window takes it over.
        video: shows the video.
        roster: lists the robots to switch to; by default the known ones.
        pad: a gamepad; None without one.
        band: says that there is no robot, above everything else; None where there is one.
    """

    def __init__(
        self,
        worker: Worker,
        changes: ThreadHandover,
        video: VideoView,
        roster: Roster | None = None,
        pad: Pad | None = None,
        *,
        band: PracticeBand | None = None,
    ) -> None:
        super().__init__()
        self._worker = worker
        self.preview_actions = PreviewActions(self, worker)
        self.read_picture_age: Callable[[], PictureAge | None] = lambda: None
        """Reads the age of the picture on the screen; None while it is unknown."""
        self.read_worst_age_ms: Callable[[], float | None] = lambda: None
        """Reads the largest age of that picture in the last half second; None while it is unknown."""
        self.read_stream: Callable[[], OwnStream | None] = lambda: None
        """Reads how the pictures of this window come; None before they do."""
        self._history, self._trail = History(), Trail()
        self._motion: Motion | None = None
        self._dismissed: PreviewRequest | None = None
        self.alarm = Alarm()
        self.next_robot: RobotChoice | None = None
        """The robot to open after this window was closed; None to end."""
        self.video = video
        self.header = TopBar(worker.target, roster or Roster())
        self.picture = PictureArea(video)
        self.banner, self.toasts = self.picture.banner, self.picture.toasts
        self.strip, self.side = BottomStrip(), SidePanel()
        self.plots = Plots(QBoxLayout.Direction.LeftToRight)
        self.driving = Driving(self, worker, self.strip, self.picture, pad)
        self.recording = RecordingActions(worker, self.side.recordings, self.picture)
        self.band = band
        self.arrangement = Arrangement(self, Parts(self.header, self.side, self.plots, self.strip, video))
        keys = cockpit_keys(self, self)
        self.picture.show_keys((*keys, *KEYS_OF_THE_HANDS))
        self.preview = self.strip.preview
        self.saver, self.sound = Saver(self, self.toasts.show_passing), AlarmSound(self.alarm, self)
        self.plots.setPalette(COCKPIT)
        self.plots.setAutoFillBackground(True)
        self._lay_out()
        self._connect(changes)
        bind_keys(self, keys)
        self.setWindowTitle("PRACTICE, no robot" if band else f"Robot {worker.target}")
        chosen = window_settings.restore(self)
        self.arrangement.panel_open, self.alarm.sound_on = chosen.panel, chosen.sound
        if chosen.exports:
            self.recording.folder = Path(chosen.exports)
        self.arrangement.arrange()
        self.refresh()

    def refresh(self) -> None:
        """Shows the latest state."""
        state, now_s = self._worker.latest(), time.monotonic()
        link = link_text(state.link, self._worker.target, now_s)
        playback = self.video.playback()
        frozen_s = None if playback.state is PlaybackState.LIVE else playback.frame_age_s
        stream = self.read_stream()
        self.header.show_state(state, link, now_s, self.read_picture_age(), frozen_s, stream=stream)
        controls = self.preview_actions.controls(state, now_s)
        self.preview.show_controls(controls)
        hidden = state.request is not None and state.request is self._dismissed
        self.toasts.show_answers(() if hidden else controls.answers)
        self._show_alarms(state, now_s)
        self.banner.show_pending(self.alarm.is_pending(LOST_LINK))
        self.banner.show_item(link)
        self.side.show_state(state, controls, self.alarm, now_s, stream)
        self.driving.show_state(state)
        self.recording.show_state(state)
        self.side.show_recordings_tab(not self.recording.absent)
        if state.snapshot:
            self._trail.add(state.snapshot.status.odometry, state.received_s)
        self._motion = motion(state, now_s, self._motion)
        self.picture.show_motion(self._motion, self._trail)
        self.picture.show_values(tile_items(state, now_s))
        self.sound.check(now_s)

    # Actions of the keys and buttons.

    def retry(self) -> None:
        """Ends the pause before the next attempt to connect."""
        self._worker.retry_now()

    def acknowledge(self, *which: Occurrence) -> None:
        """Acknowledges these alarms, or all of them."""
        self.alarm.acknowledge(*which)
        self.refresh()

    def toggle_sound(self) -> None:
        """Turns the alarm's sound on or off."""
        self.alarm.sound_on = not self.alarm.sound_on
        self.refresh()

    def toggle_boxes(self) -> None:
        """Shows or hides the boxes around objects."""
        self.video.show_overlay(not self.video.overlay_shown)

    def toggle_help(self) -> None:
        """Shows or hides the list of keys."""
        self.picture.key_help.toggle()

    def show_tab(self, number: int) -> None:
        """Shows a tab of the side panel, which is opened for it."""
        self.arrangement.show_tab(number)
        if TABS[number] == "Recordings":
            self.recording.say_if_absent()

    def search_events(self) -> None:
        """Moves to the search for events."""
        self.show_tab(1)
        self.side.events_tab.search.setFocus()

    def save_picture(self) -> None:
        """Saves the picture with its status."""
        self.saver.save_picture(self.video.latest_image(), self._worker.latest(), self.read_picture_age())

    def export_events(self) -> None:
        """Saves the listed events."""
        self.saver.export_events(self.side.events.listed, self._worker.latest())

    def show_robots(self) -> None:
        """Opens the list of robots."""
        self.header.name.showMenu()

    def escape(self) -> None:
        """Closes what lies over the picture; with nothing there, goes back to the whole window."""
        if not self.picture.key_help.isHidden():
            self.toggle_help()
        elif self.toasts.notes:
            request = self._worker.latest().request
            self._dismissed = request if request and not request.pending else None
            self.toasts.dismiss()
            self.refresh()
        elif not self.arrangement.end_picture_only():
            leave_full_screen(self)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        """Arranges the parts for the new size."""
        super().resizeEvent(event)
        self.arrangement.arrange()

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802 - Qt's name
        """Ends driving, saves the settings, and waits for a file that is being written."""
        self.driving.close()
        self.header.name.end_search()
        self._timer.stop()
        choices = Choices(self.arrangement.panel_open, self.alarm.sound_on, str(self.recording.folder))
        window_settings.save(self, choices)
        self.saver.job.wait(_SAVES_END_WITHIN_S)
        super().closeEvent(event)

    def _lay_out(self) -> None:
        column = fill(QVBoxLayout(), (self.picture, 1), self.plots, spacing=0)
        middle = QHBoxLayout()
        middle.setSpacing(0)
        middle.addLayout(column, 1)
        middle.addWidget(self.side)
        whole = fill(QVBoxLayout(self), *([self.band] if self.band else []), self.header, spacing=0)
        whole.addLayout(middle, 1)
        whole.addWidget(self.strip)

    def _connect(self, changes: ThreadHandover) -> None:
        changes.setParent(self)
        changes.delivered.connect(self.refresh)
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._tick)
        self._timer.start()
        self.video.reshaped.connect(self.arrangement.arrange)
        self.strip.arranged.connect(self.arrangement.arrange)
        self.preview_actions.acted.connect(self.refresh)
        self.preview.switched.connect(self.preview_actions.switch)
        self.preview.chosen.connect(self.preview_actions.choose)
        self.preview.camera_chosen.connect(self.preview_actions.choose_camera)
        self.banner.retry.connect(self.retry)
        self.banner.acknowledged.connect(partial(self.acknowledge, LOST_LINK))
        self.side.acknowledged.connect(self._acknowledge_one)
        self.side.acknowledge.clicked.connect(self._acknowledge_all)
        self.side.sound.clicked.connect(self.toggle_sound)
        self.side.events_tab.export_asked.connect(self.export_events)
        self.header.help_asked.connect(self.toggle_help)
        self.header.panel_toggled.connect(self.arrangement.toggle_panel)
        self.header.name.chosen.connect(self._open_other)
        self.sound.job.done.connect(self._report_sound)

    def _tick(self) -> None:
        state, now_s = self._worker.latest(), time.monotonic()
        status = state.snapshot.status if state.snapshot and not state.outdated(now_s) else None
        self._history.record(now_s, values_of(self.read_worst_age_ms(), status))
        for plots in (self.plots, self.side.plots):
            plots.show_history(self._history)
        self.refresh()

    def _show_alarms(self, state: MonitorState, now_s: float) -> None:
        """Takes what alarms; while the panel is closed, a new or worse fault appears over the picture."""
        faults = state.snapshot.status.faults if state.snapshot else ()
        for fault in self.alarm.show(faults, link_lost=is_alarming(state.link, now_s)):
            if self.side.isHidden():
                self.toasts.show_passing(Note(fault.message, FAULT_STYLES[fault.severity]))

    def _acknowledge_all(self, _checked: bool) -> None:
        self.acknowledge()

    def _acknowledge_one(self, item: FaultItem) -> None:
        if item.occurrence:
            self.acknowledge(item.occurrence)

    def _report_sound(self, note: Note | None) -> None:
        if note:
            self.toasts.show_passing(note)

    def _open_other(self, choice: RobotChoice) -> None:
        if choice.login_command:
            # Without one the next window could only say that the robot refuses it.
            text = f"{choice.name} needs a login. In a terminal, type: {choice.login_command}"
            self.toasts.show_passing(Note(text, SeverityStyle.WARNING))
            return
        self.next_robot = choice
        self.close()
