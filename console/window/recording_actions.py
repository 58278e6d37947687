"""Recording in the cockpit: what its buttons and keys do, and what they show."""

import time
from pathlib import Path

from PySide6.QtCore import QObject, QStandardPaths, Qt
from PySide6.QtWidgets import QMessageBox

from common.plain_name import plain_name
from console.client import GatewayError
from console.client.export_path import path_below
from console.monitor.monitor_state import MonitorState
from console.monitor.recorder_controls import (
    KEPT_S,
    RecorderControls,
    RecordingItem,
    deletion_question,
    recorder_controls,
)
from console.monitor.recordings_view import ExportState
from console.monitor.worker import Worker
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.window.folder_dialog import FolderDialog
from console.window.picture_area import PictureArea
from console.window.recordings_tab import RecordingsTab

_LONGEST_NAME = 63


def default_folder() -> Path:
    """Returns where exports are put: the folder "robotctl" in the desktop's folder for documents."""
    documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
    return Path(documents) / "robotctl"


class RecordingActions(QObject):
    """Connects the worker's recordings, the tab, and the tile over the picture.

    Args:
        worker: talks to the gateway; none of its calls here blocks.
        tab: has the buttons.
        picture: has the tile, and room for the answers.
    """

    def __init__(self, worker: Worker, tab: RecordingsTab, picture: PictureArea) -> None:
        super().__init__(tab)
        self._worker, self._recordings = worker, worker.recordings
        self._tab, self._picture, self._toasts = tab, picture, picture.toasts
        self._now = RecorderControls()
        self.folder = default_folder()
        """Where exports are put."""
        self.question: QMessageBox | None = None
        """The confirmation that is asked for; None while there is none."""
        self.folder_dialog: FolderDialog | None = None
        """In which the folder is chosen; None while it is not."""
        tab.record_pressed.connect(self.record)
        tab.keep_pressed.connect(self.keep)
        tab.export_pressed.connect(self.export)
        tab.pin_pressed.connect(self.pin)
        tab.delete_pressed.connect(self.delete)
        tab.folder_pressed.connect(self.choose_folder)
        tab.preset_chosen.connect(lambda: self.show_state(worker.latest()))

    @property
    def absent(self) -> str:
        """Why there is nothing to show; empty on a robot with a recorder, and before the first status."""
        return self._now.absent

    def show_state(self, state: MonitorState) -> None:
        """Shows the latest state."""
        now_s = time.monotonic()
        for note in self._recordings.take_notes():
            self._toasts.show_passing(note)
        known = state.snapshot is not None and not state.outdated(now_s)
        status = state.snapshot.status.recording if state.snapshot and known else None
        shown = self._tab.isVisible()
        self._recordings.follow(status, shown=shown)
        self._now = recorder_controls(
            state, self._recordings.view(), self._tab.preset, now_s, with_items=shown
        )
        self._picture.show_recorder(self._now.tile)
        if shown:
            self._tab.show_folder(self.folder)
            self._tab.show_controls(self._now)
            self._recordings.show_pictures(self._tab.list.visible())

    # Actions of the keys and buttons.

    def record(self) -> None:
        """Starts a recording, or stops the one that runs."""
        if self._refuses(self._now.record.reason):
            return
        if self._now.on:
            self._recordings.stop(self._now.running_id)
        else:
            self._recordings.start(self._tab.label.text().strip(), self._tab.preset)
            self._tab.label.clear()

    def keep(self) -> None:
        """Keeps the last seconds."""
        if not self._refuses(self._now.keep.reason):
            self._recordings.keep(self._tab.label.text().strip(), KEPT_S)

    def export(self, item: RecordingItem) -> None:
        """Begins an export, or cancels the one that runs."""
        if item.copy and item.copy.state is ExportState.RUNNING:
            self._recordings.cancel_export()
            return
        try:
            folder = path_below(self._robots_folder(), item.recording.id)
        except GatewayError as error:
            self._toasts.show_passing(Note(str(error), SeverityStyle.BAD))
            return
        self._recordings.export(item.recording.id, folder)

    def pin(self, item: RecordingItem) -> None:
        """Pins a recording, or ends that."""
        self._recordings.pin(item.recording.id, not item.recording.pinned)

    def delete(self, item: RecordingItem) -> None:
        """Deletes a recording, once that is confirmed. A question that is open already gives way."""
        if self.question:
            self.question.close()
        box = QMessageBox(self._tab.window())
        box.setIcon(QMessageBox.Icon.Warning)
        box.setWindowTitle("Delete a recording")
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setText(deletion_question(item))
        delete = box.addButton("Delete", QMessageBox.ButtonRole.DestructiveRole)
        box.setDefaultButton(box.addButton(QMessageBox.StandardButton.Cancel))
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        delete.clicked.connect(lambda: self._recordings.delete(item.recording))
        box.finished.connect(self._forget_question)
        self.question = box
        # Not modal: the window goes on to show the robot, and its STOP to work.
        box.setModal(False)
        box.show()

    def choose_folder(self) -> None:
        """Asks where exports are put."""
        if self.folder_dialog:
            self.folder_dialog.raise_()
            self.folder_dialog.activateWindow()
            return
        dialog = FolderDialog(self._tab.window(), "Put exports into", self.folder)
        dialog.fileSelected.connect(self._take_folder)
        dialog.finished.connect(self._forget_folder_dialog)
        self.folder_dialog = dialog
        dialog.show()

    def _take_folder(self, name: str) -> None:
        self.folder = Path(name)
        self.show_state(self._worker.latest())

    def _forget_question(self) -> None:
        self.question = None

    def _forget_folder_dialog(self) -> None:
        self.folder_dialog = None

    def _robots_folder(self) -> Path:
        snapshot = self._worker.latest().snapshot
        name = snapshot.status.gateway_name if snapshot else ""
        return self.folder / plain_name(name or "", _LONGEST_NAME, also="_")

    def say_if_absent(self) -> None:
        """Says why there is nothing to show, if that is so."""
        self._refuses("")

    def _refuses(self, reason: str) -> bool:
        """Says why an action of a key can't be carried out. Returns whether there is a reason."""
        if why := self._now.absent or reason:
            self._toasts.show_passing(Note(why, SeverityStyle.WARNING))
        return bool(why)
