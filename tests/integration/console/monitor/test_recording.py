"""The recording panel: a real preview, recorder and gateway, and messages that are recorded."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton

from console.receiver.key_frame import PICTURE_BYTES
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from console.window.recordings_tab import RecordingsTab
from console.window.side_panel import TABS
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.qt import keep_screenshot, press, until
from tests.support.ros import simulated_robot
from tests.support.running_preview import RunningPreview
from tests.support.running_recorder import RecorderProgram, recorder_program

pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timeout(240)]

WINDOW = (1280, 800)
PROFILE = {"width_px": 1280, "height_px": 720, "fps": 15, "bitrate_kbps": 2000}
PRESETS = {
    "driving": {"description": "motion and state", "topics": ["*"], "video": True},
    "odometry": {"description": "motion alone", "topics": ["/odom"], "video": False},
}


@dataclass
class Operator:
    """An operator in front of the window."""

    window: MonitorWindow
    gateway: GatewayProgram
    recorder: RecorderProgram

    @property
    def tab(self) -> RecordingsTab:
        return self.window.side.recordings

    def click(self, button: QAbstractButton) -> None:
        until(button.isEnabled, f"{button.text()} can be pressed: {button.accessibleDescription()}")
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)

    def said(self, words: str) -> str:
        return until(lambda: next((n.text for n in self.window.toasts.notes if words in n.text), ""), words)

    def rows(self) -> list[str]:
        return [self.tab.list.item(row).text() for row in range(self.tab.list.count())]

    def choose(self, words: str) -> None:
        row = until(lambda: 1 + next((n for n, r in enumerate(self.rows()) if words in r), -1), words) - 1
        self.tab.list.setCurrentRow(row)


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[GatewayProgram, RecorderProgram]]:
    directory = tmp_path_factory.mktemp("robot")
    tap = str(directory / "tap.sock")
    preview = {"profiles": {"balanced": PROFILE}, "video_tap": {"socket": tap}}
    ring = {"preset": "driving", "seconds": 60}
    with (
        simulated_robot(directory),
        RunningPreview(directory, preview),
        recorder_program(directory, video={"socket": tap}, presets=PRESETS, ring=ring) as recorder,
        gateway_program(directory, recording={"socket": str(recorder.socket)}) as gateway,
    ):
        yield gateway, recorder


@pytest.fixture
def operator(robot: tuple[GatewayProgram, RecorderProgram], tmp_path: Path) -> Iterator[Operator]:
    gateway, recorder = robot
    with monitor(f"127.0.0.1:{gateway.port}") as window:
        window.showNormal()
        window.resize(*WINDOW)
        window.activateWindow()
        until(window.isActiveWindow, "the window is active")
        window.recording.folder = tmp_path / "exports"
        window.show_tab(TABS.index("Recordings"))
        made = Operator(window, gateway, recorder)
        until(made.tab.record.isEnabled, "a recording can be started", 40)
        yield made


def test_a_recording_from_the_first_second_to_the_last_copy(operator: Operator, tmp_path: Path) -> None:
    window, tab = operator.window, operator.tab
    press(window, Qt.Key.Key_P)
    assert [tab.presets.itemText(number) for number in range(tab.presets.count())] == list(PRESETS)
    assert "motion and state" in tab.meaning.text()
    tab.label.setText("lap 1")
    press(window, Qt.Key.Key_C)
    until(lambda: tab.record.text() == "Stop recording", "a recording runs")
    until(lambda: "with video" in tab.running.text(), "with its video", 40)
    until(lambda: tab.room.text().startswith("Room for") and "/s" in tab.room.text(), "how long it may go on")
    until(lambda: window.picture.recorder.cell.word.text() == "REC", "the tile")
    until(tab.keep.isEnabled, "the ring has something to keep")
    press(window, Qt.Key.Key_K)
    operator.said("is being made")
    operator.choose("Snapshot")
    press(window, Qt.Key.Key_C)
    until(lambda: tab.record.text() == "Record", "it has ended")

    operator.choose("lap 1")
    until(tab.delete.isEnabled, "it is listed as ended")
    chosen = tab.list.chosen
    assert chosen
    recording_id = chosen.recording.id
    picture = until(lambda: window._worker.recordings.view().pictures.get(recording_id), "its picture", 40)
    assert len(picture) == PICTURE_BYTES
    assert len({picture[at : at + 3] for at in range(0, len(picture), 4)}) > 20, "colours"
    operator.click(tab.pin)
    until(lambda: tab.pin.text() == "Unpin", "it is pinned")
    assert "unpin it first" in tab.delete.accessibleDescription()

    tab.label.setText("lap 2")
    press(window, Qt.Key.Key_C)
    until(lambda: "lap 2" in tab.running.text(), "another one runs")
    keep_screenshot(window, "recording", fills_in_s=12, at_last=lambda: pictured(operator))
    operator.click(tab.record)
    until(lambda: tab.record.text() == "Record", "it has ended")
    assert tab.list.chosen
    assert tab.list.chosen.recording.id == recording_id, "the choice stays while others come"

    operator.click(tab.export)
    operator.said("verified")
    assert list((tmp_path / "exports").rglob("*.mcap"))
    assert not list((tmp_path / "exports").rglob("*.part"))
    operator.click(tab.pin)
    until(lambda: tab.pin.text() == "Pin", "it is not pinned any more")
    operator.click(tab.delete)
    until(lambda: window.recording.question, "a confirmation").reject()
    until(lambda: window.recording.question is None, "it is answered")
    operator.click(tab.delete)
    question = until(lambda: window.recording.question, "a confirmation")
    assert "lap 1" in question.text()
    delete = next(button for button in question.buttons() if button.text() == "Delete")
    QTest.mouseClick(delete, Qt.MouseButton.LeftButton)
    until(lambda: not any("lap 1" in row for row in operator.rows()), "it is gone")


def pictured(operator: Operator) -> None:
    """The snapshot has a picture as well, and no message lies over the live one."""
    until(lambda: len(operator.window._worker.recordings.view().pictures) == 2, "both pictures", 40)
    operator.window.toasts.dismiss()
