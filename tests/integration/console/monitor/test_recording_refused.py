"""The recording panel where something is refused, broken or missing; its recorder is a double."""

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QFileDialog,
    QLineEdit,
    QListWidget,
    QMessageBox,
    QProgressBar,
    QWidget,
)

from console.presentation.severity_style import SeverityStyle
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from console.window.recordings_tab import RecordingsTab
from console.window.side_panel import TABS
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.qt import let_pass, press, until
from tests.support.recorder_double import CHUNK_BYTES, RecorderDouble
from tests.support.recording_gateway import recording_robot

RECORDINGS = TABS.index("Recordings")
FILE = "data/000000.mcap"
LONG = bytes(range(256)) * 4 * 1024 * 100
"""100 chunks: more than may be on its way."""


@dataclass
class Robot:
    """What runs in another thread."""

    loop: asyncio.AbstractEventLoop
    recorder: RecorderDouble
    port: int = 0
    ready: threading.Event = field(default_factory=threading.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)

    def do(self, act: Callable[[RecorderDouble], object]) -> None:
        """Changes the recorder, in its thread."""
        done = threading.Event()

        def change() -> None:
            act(self.recorder)
            self.recorder.changed()
            done.set()

        self.loop.call_soon_threadsafe(change)
        assert done.wait(10)

    async def serve(self, directory: Path) -> None:
        async with recording_robot(directory, self.recorder) as served:
            self.port = served.port
            self.ready.set()
            await self.ended.wait()


@contextmanager
def robot_in_a_thread(directory: Path) -> Iterator[Robot]:
    loop = asyncio.new_event_loop()
    robot = Robot(loop, RecorderDouble())
    robot.recorder.add({FILE: LONG}, id="one", label="lap 0", video_frames=9)

    def run() -> None:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(robot.serve(directory))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert robot.ready.wait(30)
        yield robot
    finally:
        loop.call_soon_threadsafe(robot.ended.set)
        thread.join(30)
        assert not thread.is_alive()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    with robot_in_a_thread(tmp_path) as robot:
        yield robot


@pytest.fixture
def window(robot: Robot, tmp_path: Path) -> Iterator[MonitorWindow]:
    with monitor(f"127.0.0.1:{robot.port}") as window:
        window.recording.folder = tmp_path / "exports"
        window.show_tab(RECORDINGS)
        until(window.side.recordings.record.isEnabled, "a recording can be started")
        until(lambda: window.side.recordings.list.chosen, "the list")
        yield window


def tab_of(window: MonitorWindow) -> RecordingsTab:
    return window.side.recordings


def click(button: QAbstractButton) -> None:
    until(button.isEnabled, f"{button.text()} can be pressed")
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def said(window: MonitorWindow, words: str) -> None:
    until(lambda: any(words in note.text for note in window.toasts.notes), words)


def test_without_a_recorder_there_is_no_tab_and_its_keys_say_why() -> None:
    with serving(GatewayDouble()) as port, monitor(f"127.0.0.1:{port}") as window:
        until(lambda: window.recording.absent, "a status")
        assert not window.side.tabs.isTabVisible(RECORDINGS)
        assert window.picture.recorder.isHidden()
        press(window, Qt.Key.Key_C)
        said(window, "not set up for recording")
        window.toasts.dismiss()
        press(window, Qt.Key.Key_4, Qt.KeyboardModifier.ControlModifier)
        said(window, "not set up for recording")


def test_a_key_frame_that_is_none_leaves_a_grey_tile_and_the_window(window: MonitorWindow) -> None:
    until(lambda: window._worker.recordings.view().pictures == {"one": b""}, "no picture")
    assert tab_of(window).list.item(0).icon().availableSizes()
    assert tab_of(window).record.isEnabled()


def one_chunk(recorder: RecorderDouble) -> None:
    """Wakes the export that rests; it rests again after its next chunk."""
    recorder.flowing.set()
    recorder.flowing.clear()


def test_an_export_is_cancelled_and_goes_on_where_it_was(
    window: MonitorWindow, robot: Robot, tmp_path: Path
) -> None:
    tab = tab_of(window)
    robot.recorder.flowing.clear()
    click(tab.export)

    def first_chunk_is_shown() -> bool:
        if not robot.recorder.sent_bytes:
            robot.do(one_chunk)
        return tab.bar.isVisible() and tab.bar.value() > 0

    until(first_chunk_is_shown, "its first chunk")
    assert tab.export.text() == "Cancel export"
    assert "of 104.9 MB" in tab.copied.text()
    assert "being exported" in tab.delete.accessibleDescription()
    click(tab.export)
    until(lambda: tab.export.text() == "Resume export", "it has ended")
    (part,) = (tmp_path / "exports").rglob("*.part")
    left = part.stat().st_size
    assert left >= CHUNK_BYTES
    assert str(part.parents[1]) in tab.copied.text()
    robot.do(lambda recorder: recorder.flowing.set())
    click(tab.export)
    until(lambda: "verified" in tab.copied.text(), "it is whole", 40)
    assert part.with_suffix("").read_bytes() == LONG
    assert robot.recorder.exports == [(FILE, 0), (FILE, left)]


def test_a_disk_that_fails_is_red_over_the_picture_and_bars_the_buttons(
    window: MonitorWindow, robot: Robot
) -> None:
    tab, tile = tab_of(window), window.picture.recorder

    def fail(recorder: RecorderDouble) -> None:
        recorder.report.status.state = pb.RECORDER_STATE_FAULTED
        recorder.report.status.last_error = "the disk is read-only"

    assert tile.isHidden(), "all is well, and nothing runs"
    robot.do(fail)
    until(lambda: not tab.record.isEnabled(), "nothing can be recorded")
    assert "read-only" in tab.record.accessibleDescription()
    assert "read-only" in tab.why.text()
    assert tab.state.marker.severity is SeverityStyle.BAD
    until(tile.isVisible, "the tile")
    assert "FAULTED" in tile.cell.accessibleName()
    press(window, Qt.Key.Key_F)
    assert tile.isVisible(), "in the picture alone, too"
    press(window, Qt.Key.Key_K)
    said(window, "read-only")


def test_a_robot_without_a_ring_says_so(window: MonitorWindow, robot: Robot) -> None:
    def without(recorder: RecorderDouble) -> None:
        recorder.report.status.ring_s = 0
        recorder.report.status.presets[0].in_ring = False

    robot.do(without)
    tab = tab_of(window)
    until(lambda: not tab.keep.isEnabled(), "nothing can be kept")
    assert "keeps no ring" in tab.why.text()
    assert tab.record.isEnabled()


def test_a_refusal_is_said_in_the_robots_words(window: MonitorWindow, robot: Robot) -> None:
    robot.do(lambda recorder: recorder.copy_wanted.add("one"))
    click(tab_of(window).delete)
    question = until(lambda: window.recording.question, "a confirmation")
    delete = next(button for button in question.buttons() if button.text() == "Delete")
    QTest.mouseClick(delete, Qt.MouseButton.LeftButton)
    said(window, "it is not copied yet")
    assert "one" in robot.recorder.recordings


def test_there_is_one_question_and_one_dialog_at_a_time(window: MonitorWindow) -> None:
    """The window stays usable beside them, so that both can be asked for again."""
    click(tab_of(window).delete)
    first = until(lambda: window.recording.question, "a confirmation")
    click(tab_of(window).delete)
    until(lambda: window.recording.question not in (None, first), "the next one")
    assert sum(box.isVisible() for box in window.findChildren(QMessageBox)) == 1
    for _ in range(2):
        window.recording.choose_folder()
    (dialog,) = (each for each in window.findChildren(QFileDialog) if each.isVisible())
    dialog.reject()
    until(lambda: window.recording.folder_dialog is None, "it is answered")


@pytest.mark.parametrize("exists", [True, False])
def test_the_folder_of_exports_may_be_one_that_is_yet_to_be_made(
    window: MonitorWindow, tmp_path: Path, exists: bool
) -> None:
    """Qt's refusal of one that does not exist is modal, and would keep the button STOP from working."""
    folder = tmp_path / "exports"
    if exists:
        folder.mkdir()
    window.recording.folder = folder
    window.recording.choose_folder()
    dialog = until(lambda: window.recording.folder_dialog, "the dialog")
    assert not dialog.isModal()
    window.recording.folder = tmp_path
    dialog.accept()
    until(lambda: window.recording.folder_dialog is None, "it is answered")
    assert window.recording.folder == folder


@pytest.mark.parametrize(
    ("typed", "why"),
    [("a file", "a file, not a folder"), ("a file/below", "Not a directory"), ("x" * 300, "name too long")],
    ids=["a file", "below a file", "a long name"],
)
def test_a_folder_that_is_not_taken_has_a_reason_in_the_dialog(
    window: MonitorWindow, tmp_path: Path, typed: str, why: str
) -> None:
    (tmp_path / "a file").touch()
    window.recording.folder = tmp_path
    window.recording.choose_folder()
    dialog = until(lambda: window.recording.folder_dialog, "the dialog")
    (field,) = dialog.findChildren(QLineEdit)
    field.setText(str(tmp_path / typed))
    assert not dialog.refusal.isVisible()
    dialog.accept()
    until(dialog.refusal.isVisible, "the reason")
    assert why in dialog.refusal.text()
    assert window.recording.folder_dialog is dialog, "another folder may be chosen"
    dialog.reject()
    until(lambda: window.recording.folder_dialog is None, "it is answered")
    assert window.recording.folder == tmp_path


def test_the_folder_is_the_one_in_the_field_also_after_a_refusal(
    window: MonitorWindow, tmp_path: Path
) -> None:
    """Qt may have the folder above it marked in the list by then, and would take that."""
    window.recording.folder = tmp_path
    window.recording.choose_folder()
    dialog = until(lambda: window.recording.folder_dialog, "the dialog")
    until(dialog.isActiveWindow, "it has the keys")
    for name in ("x" * 300, "new"):
        (field,) = dialog.findChildren(QLineEdit)
        field.setFocus()
        until(field.hasFocus, "its field has them")
        field.selectAll()
        QTest.keyClicks(field, str(tmp_path / name))
        let_pass(0.3)
        dialog.accept()
    until(lambda: window.recording.folder_dialog is None, "it is answered")
    assert window.recording.folder == tmp_path / "new"


def test_everything_has_a_name_and_can_be_reached_by_keys(window: MonitorWindow) -> None:
    tab = tab_of(window)
    for kind in (QAbstractButton, QComboBox, QLineEdit, QListWidget, QProgressBar):
        for part in tab.findChildren(kind):
            if part.objectName().startswith("qt_") or isinstance(part.parent(), QComboBox | QLineEdit):
                continue
            named = part.accessibleName() or (part.text() if isinstance(part, QAbstractButton) else "")
            assert named, part
    reached: set[QWidget] = set()
    tab.presets.setFocus()
    for _ in range(12):
        focus = window.focusWidget()
        assert focus
        reached.add(focus)
        QTest.keyClick(focus, Qt.Key.Key_Tab)
    assert {tab.label, tab.record, tab.keep, tab.list, tab.export, tab.pin, tab.delete} <= reached
