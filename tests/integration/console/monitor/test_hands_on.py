"""The window under an operator's hands: clicks, keys, refusals; behind it a gateway that the test plays."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton, QStyledItemDelegate, QWidget

from console.client import PreviewProfile
from console.monitor.event_log import EventLine, EventLog
from console.window.event_list import EventList
from console.window.monitor_window import MonitorWindow
from console.window.preview_panel import PreviewPanel
from console.window.programs import monitor
from omniseer.gateway.v1 import fault_pb2, preview_pb2, system_status_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.gateway_double import GatewayDouble, StreamingGatewayDouble, serving
from tests.support.markup import MARKUP, mark_up, no_widget_takes_markup, shown_by_qt
from tests.support.promise import keeps
from tests.support.qt import keep_screenshot, let_pass, press, until

LOW, BALANCED, HIGH = PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY
CLOSES_WITHIN_S = 2.0


@dataclass
class Desk:
    """The window, and the gateway it talks to."""

    window: MonitorWindow
    gateway: GatewayDouble

    @property
    def preview(self) -> PreviewPanel:
        return self.window.preview

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        press(QApplication.focusWidget() or self.window, key, modifier)

    def click(self, button: QPushButton) -> None:
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)

    def free(self) -> None:
        """Waits until the controls may be touched."""
        until(self.preview.switch.isEnabled, "the controls may be touched")

    def state_is(self, word: str) -> None:
        until(lambda: self.preview.state.word.text() == word, f"the preview is shown as {word}")

    def notes(self) -> list[str]:
        """Answers over the picture, then the robot's own in the side panel."""
        shown = (*self.window.toasts.lines.shown, *self.window.side.notes.shown)
        return [line.text.text() for line in shown if line.text.text()]


@pytest.fixture(params=[StreamingGatewayDouble, GatewayDouble], ids=["streamed", "polled"])
def desk_work(request: pytest.FixtureRequest) -> Iterator[Desk]:
    """In front of a gateway that streams its status, and of an older one, which is polled."""
    gateway = request.param()
    with serving(gateway) as port, monitor(f"127.0.0.1:{port}") as window:
        window.activateWindow()
        made = Desk(window, gateway)
        made.free()
        yield made
        gateway.hold.set()


def test_a_click_turns_the_preview_on_and_off(desk_work: Desk) -> None:
    desk_work.click(desk_work.preview.switch)
    desk_work.state_is("RUNNING")
    assert desk_work.preview.switch.text() == "&Stop preview"
    desk_work.free()
    desk_work.click(desk_work.preview.switch)
    desk_work.state_is("DISABLED")
    assert [request.enabled for request in desk_work.gateway.preview_requests] == [True, False]


def test_keys_do_the_same(desk_work: Desk) -> None:
    def requested(profile: preview_pb2.PreviewProfile.ValueType) -> bool:
        return desk_work.gateway.preview_requests[-1].profile == profile

    desk_work.press(Qt.Key.Key_P)
    desk_work.state_is("RUNNING")
    for key, profile in (
        (Qt.Key.Key_1, preview_pb2.PREVIEW_PROFILE_LOW_BW),
        (Qt.Key.Key_3, preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY),
        (Qt.Key.Key_2, preview_pb2.PREVIEW_PROFILE_BALANCED),
    ):
        desk_work.free()
        desk_work.press(key)
        until(partial(requested, profile), "the profile is asked for")
    desk_work.free()
    desk_work.press(Qt.Key.Key_P)
    desk_work.state_is("DISABLED")


def test_while_it_is_off_a_profile_is_marked_and_taken_by_the_next_start(desk_work: Desk) -> None:
    desk_work.press(Qt.Key.Key_3)
    until(desk_work.preview.profiles[HIGH].isChecked, "the mark is shown")
    let_pass(0.5)
    assert desk_work.preview.profiles[HIGH].isChecked(), "the robot's next answer takes the mark away"
    assert not desk_work.gateway.preview_requests
    desk_work.press(Qt.Key.Key_P)
    desk_work.state_is("RUNNING")
    assert desk_work.gateway.preview_requests[-1].profile == preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY


def test_a_refusal_is_shown_in_the_robots_words(desk_work: Desk) -> None:
    desk_work.gateway.accept = False
    desk_work.click(desk_work.preview.switch)
    until(lambda: desk_work.notes() == ["The robot refused: the robot is being serviced"], "the refusal")
    assert desk_work.preview.switch.isEnabled()
    keep_screenshot(desk_work.window, "refused")


def test_a_fault_is_shown_with_what_to_do(desk_work: Desk) -> None:
    desk_work.gateway.works = False
    desk_work.click(desk_work.preview.switch)
    desk_work.state_is("FAULTED")
    until(lambda: desk_work.notes() == ["no encoder works. Type: robot-preview encoders"], "what to do")


def test_while_the_robot_thinks_nothing_can_be_pressed_and_the_focus_comes_back(desk_work: Desk) -> None:
    button = desk_work.preview.profiles[BALANCED]
    desk_work.click(desk_work.preview.switch)
    desk_work.state_is("RUNNING")
    desk_work.free()
    button.setFocus()
    desk_work.gateway.hold.clear()
    desk_work.press(Qt.Key.Key_Space)
    until(lambda: not desk_work.preview.switch.isEnabled(), "the controls are locked")
    assert not any(each.isEnabled() for each in desk_work.preview.profiles.values())
    asked = len(desk_work.gateway.preview_requests)
    press(desk_work.window, Qt.Key.Key_P)
    desk_work.gateway.hold.set()
    desk_work.free()
    assert button.hasFocus()
    assert len(desk_work.gateway.preview_requests) <= asked + 1, "a key pressed meanwhile asks for nothing"


def test_everything_is_reached_by_the_keyboard(desk_work: Desk) -> None:
    desk_work.press(Qt.Key.Key_2, Qt.KeyboardModifier.ControlModifier)
    until(desk_work.window.side.events.isVisible, "the tab of the events")
    reached: list[QWidget] = []
    desk_work.preview.switch.setFocus()
    for _ in range(40):
        focus = QApplication.focusWidget()
        assert focus
        if focus in reached:
            break
        reached.append(focus)
        desk_work.press(Qt.Key.Key_Tab)
    buttons = [desk_work.preview.switch, *desk_work.preview.profiles.values()]
    assert reached[: len(buttons)] == buttons
    window = desk_work.window
    events = window.side.events_tab
    bar = (window.header.name, window.header.panel_button, window.header.help_button)
    for widget in (*bar, window.side.sound, events.severity, events.export, events.search, events.list):
        assert widget in reached, widget.accessibleName()


def test_mnemonics_press_the_buttons(desk_work: Desk) -> None:
    desk_work.press(Qt.Key.Key_S, Qt.KeyboardModifier.AltModifier)
    desk_work.state_is("RUNNING")
    desk_work.free()
    desk_work.press(Qt.Key.Key_L, Qt.KeyboardModifier.AltModifier)
    until(
        lambda: desk_work.gateway.preview_requests[-1].profile == preview_pb2.PREVIEW_PROFILE_LOW_BW,
        "low bandwidth is asked",
    )


def test_full_screen_and_back(desk_work: Desk) -> None:
    desk_work.press(Qt.Key.Key_F11)
    until(desk_work.window.isFullScreen, "the whole screen")
    desk_work.press(Qt.Key.Key_Escape)
    until(lambda: not desk_work.window.isFullScreen(), "a window again")
    desk_work.press(Qt.Key.Key_F11)
    until(desk_work.window.isFullScreen, "the whole screen again")
    desk_work.press(Qt.Key.Key_F11)
    until(lambda: not desk_work.window.isFullScreen(), "a window again")


def test_q_closes(desk_work: Desk) -> None:
    desk_work.press(Qt.Key.Key_Q)
    until(lambda: not desk_work.window.isVisible(), "the window is closed")


def test_a_gateway_that_hangs_is_reported_and_the_window_lives_on(desk_work: Desk) -> None:
    desk_work.gateway.hold.clear()
    until(lambda: desk_work.window.header.link.word.text() == "unreachable", "the silence is noticed")
    assert desk_work.window.banner.isVisible()
    assert not desk_work.preview.switch.isEnabled()
    desk_work.press(Qt.Key.Key_F11)
    until(desk_work.window.isFullScreen, "the window still reacts")
    desk_work.gateway.hold.set()
    desk_work.click(desk_work.window.banner.button)
    desk_work.free()
    assert not desk_work.window.banner.isVisible()


@pytest.mark.timed
def test_closing_ends_everything_although_the_gateway_hangs() -> None:
    keeps(CLOSES_WITHIN_S, "s from closing to the end", closed_during_a_call_s)


def closed_during_a_call_s() -> float:
    gateway = StreamingGatewayDouble()
    with serving(gateway) as port:
        with monitor(f"127.0.0.1:{port}") as window:
            until(window.preview.switch.isEnabled, "it is connected")
            gateway.hold.clear()
            press(window, Qt.Key.Key_P)
            until(lambda: not window.preview.switch.isEnabled(), "a request is on its way")
            window.close()
            closed_s = time.monotonic()
        took_s = time.monotonic() - closed_s
        gateway.hold.set()
    return took_s


@pytest.mark.parametrize("state", [states.PREVIEW_DISABLED, states.PREVIEW_FAULTED])
def test_what_the_robot_says_is_never_markup(desk_work: Desk, state: states.PreviewState.ValueType) -> None:
    status = system_status_pb2.SystemStatus()
    mark_up(status)
    for fault in status.faults:
        fault.severity, fault.active = fault_pb2.FAULT_SEVERITY_ERROR, True
    # An address that is none would be reported as this computer's own finding.
    status.preview.endpoint.Clear()
    status.preview.state = state
    desk_work.gateway.status.CopyFrom(status)
    window = desk_work.window
    until(lambda: MARKUP in window.side.faults.shown[0].text.text(), "the fault")
    until(desk_work.notes, "the robot's notes")
    assert MARKUP in shown_by_qt(window.header.name.toolTip())
    assert MARKUP in shown_by_qt(window.header.target.toolTip())
    assert any(MARKUP in shown_by_qt(line.text.toolTip()) for line in window.side.notes.shown)
    no_widget_takes_markup(window)
    assert type(window.side.events.itemDelegate()) is QStyledItemDelegate, "Qt's own one draws plain text"


def test_events_of_impossible_times_are_listed() -> None:
    events = EventList()
    times_s = (1e19, -1e19, 1e308, 253_402_300_799.0)
    events.show_log(EventLog().with_lines(EventLine(at_s, "gone far") for at_s in times_s))
    assert events.lines[1:] == ["--:--:--  gone far"] * 3


@pytest.fixture
def in_japan(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as changed:
        changed.setenv("TZ", "JST-9")
        time.tzset()
        yield
    time.tzset()


@pytest.mark.usefixtures("in_japan")
def test_the_times_of_events_have_their_zone_above_them(desk_work: Desk) -> None:
    desk_work.window.search_events()
    zone = desk_work.window.side.events_tab.zone
    until(lambda: zone.text() == "Times: UTC+09:00", "the zone")
    assert zone.isVisible()
    assert zone.fontMetrics().horizontalAdvance(zone.text()) <= zone.contentsRect().width(), "it is elided"


def test_what_passes_its_focus_on_to_a_part_of_its_own_belongs_to_no_window(desk_work: Desk) -> None:
    alone = QWidget()
    alone.setFocusProxy(QPushButton(alone))
    for kind in (QEvent.Type.FocusOut, QEvent.Type.WindowDeactivate):
        QApplication.sendEvent(alone, QEvent(kind))
    hands = desk_work.window.driving.hands
    assert not hands._is_ours(alone)
    alone.setFocusProxy(desk_work.window.preview.switch)
    assert hands._is_ours(alone), "as the suggestions for a field of this window"


def test_a_hundred_faults_do_not_burst_the_window(desk_work: Desk) -> None:
    before = desk_work.window.size()
    for number in range(100):
        desk_work.gateway.status.faults.add(
            id=str(number),
            severity=2,
            component="lidar",
            message="word " * 60,
            remedy="do " * 60,
            active=True,
        )
    desk_work.gateway.status.preview.state = states.PREVIEW_FAULTED
    desk_work.gateway.status.preview.last_error = "reason " * 80
    until(lambda: len(desk_work.window.side.faults.shown) == 100, "all of them")
    let_pass(0.3)
    assert desk_work.window.size() == before
    assert desk_work.window.video.height() >= 180
    keep_screenshot(desk_work.window, "hundred-faults")
    del desk_work.gateway.status.faults[:]
    until(lambda: len(desk_work.window.side.faults.shown) == 1, "they have ended")
