"""The bar above the picture: robot, health, battery, link, age of the picture, mode, time."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QVBoxLayout, QWidget

from console.monitor.bar_items import (
    battery_item,
    clock_item,
    health_item,
    link_item,
    mode_item,
    picture_item,
    reported_age_ms,
)
from console.monitor.link import LinkText
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import UNKNOWN
from console.presentation.own_stream import OwnStream
from console.presentation.picture_age import PictureAge
from console.robots.roster import Roster
from console.window.battery_gauge import BatteryGauge
from console.window.cell import SMALL, Cell, SmallLabel
from console.window.labels import set_text, set_tool_tip, width_of
from console.window.layout import fill
from console.window.robot_switcher import RobotSwitcher
from console.window.theme import COCKPIT, Marker

HEIGHT_PX: Final = 48
_WIDEST_LINK: Final = ("not trusted", "SLOW \u00b7 100 ms \u00b7 loss 10.0 % \u00b7 Wi-Fi -58 dBm")
_USUAL_TARGET: Final = "192.168.100.10:50051"


class TopBar(QWidget):
    """What an operator must see at a glance, always in the same places.

    Args:
        target: the robot's address.
        roster: the robots to switch to.
    """

    help_asked = Signal()
    panel_toggled = Signal()

    def __init__(self, target: str, roster: Roster) -> None:
        super().__init__()
        self.setPalette(COCKPIT)
        self.setAutoFillBackground(True)
        self.setFixedHeight(HEIGHT_PX)
        self.name, self.target = RobotSwitcher(roster, target), SmallLabel()
        set_text(self.target, target)
        self.battery_gauge = BatteryGauge()
        self.health = Cell("Health", ("DEGRADED", "2 errors, 2 warnings"), Marker())
        self.battery = Cell("Battery", ("100 %", "LOW, 12.6 V"), self.battery_gauge)
        self.link = Cell("Link", _WIDEST_LINK, Marker())
        self.picture = Cell("Picture", ("1000 \u00b1 10 ms", "oldest of other viewers"), Marker())
        self.mode = Cell("Mode", ("autonomous", "last known"), None)
        self.clock = Cell("Time", ("23:59:59", "UTC+00:00"), None)
        self.panel_button = _button("Panel", "Side panel (F9)", checkable=True)
        self.help_button = _button("?", "Keys (F1)")
        self.help_button.clicked.connect(self.help_asked)
        self.panel_button.clicked.connect(self.panel_toggled)
        self._lay_out()

    def show_state(
        self,
        state: MonitorState,
        link: LinkText,
        now_s: float,
        age: PictureAge | None = None,
        frozen_s: float | None = None,
        *,
        stream: OwnStream | None = None,
    ) -> None:
        """Shows the latest state.

        Args:
            state: of robot and connection.
            link: the connection's text.
            now_s: on the monotonic clock.
            age: of the picture on the screen; None while it is unknown.
            frozen_s: how long the picture has been frozen; None while it is not.
            stream: how the pictures of this window come; None before they do.
        """
        if state.snapshot:
            status = state.snapshot.status
            self.name.show_name(status.gateway_name or "robot")
            set_tool_tip(self.target, f"Gateway {status.gateway_version or UNKNOWN}")
        battery = battery_item(state, now_s)
        self.battery_gauge.show_item(battery)
        self.battery.show_item(battery)
        self.health.show_item(health_item(state, now_s))
        self.link.show_item(link_item(state, link, now_s, stream))
        others_ms = reported_age_ms(state, now_s)
        self.picture.show_item(picture_item(age, frozen_s, stream, others_ms=others_ms))
        self.mode.show_item(mode_item(state, now_s))
        self.clock.show_item(clock_item())

    def _lay_out(self) -> None:
        robot = fill(QVBoxLayout(), self.name, self.target, spacing=0, margins=(0, 2, 0, 3))
        self.target.setMinimumWidth(round(width_of(_USUAL_TARGET) * SMALL))
        self.target.setContentsMargins(4, 0, 0, 0)
        cells = (self.battery, self.link, self.picture, self.mode, self.clock)
        parts = (robot, (self.health, 1), *cells, self.panel_button, self.help_button)
        fill(QHBoxLayout(self), *parts, spacing=14, margins=(6, 0, 8, 0))


def _button(text: str, tip: str, *, checkable: bool = False) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    set_tool_tip(button, tip)
    button.setAccessibleName(tip)
    button.setCheckable(checkable)
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    return button
