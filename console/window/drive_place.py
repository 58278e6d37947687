"""The place of driving in the bottom strip, on robots that accept velocity commands."""

from typing import Final

from PySide6.QtWidgets import QFrame, QHBoxLayout, QVBoxLayout, QWidget

from console.client.results import Teleop, TeleopState
from console.presentation.formatting import quantity
from console.window.cell import SmallLabel
from console.window.labels import PlainLabel, set_bold, set_text
from console.window.layout import fill
from console.window.theme import DimLabel

_STOP_WIDTH_PX: Final = 132


class DrivePlace(QWidget):
    """The robot's limits, and at the right end, in a place that nothing moves, room for STOP.

    This window does not drive: there is no button that would do nothing.
    """

    def __init__(self) -> None:
        super().__init__()
        self.state, self.limits = PlainLabel(), SmallLabel()
        set_bold(self.state, True)
        self.stop_place = QFrame()
        self.stop_place.setFrameShape(QFrame.Shape.StyledPanel)
        self.stop_place.setFixedWidth(_STOP_WIDTH_PX)
        self.stop_place.setAccessibleName("Place of STOP; this window does not drive")
        fill(QHBoxLayout(self.stop_place), DimLabel("no driving here"), margins=(12, 4, 12, 4))
        self.limits.setMinimumWidth(_STOP_WIDTH_PX)
        texts = QVBoxLayout()
        texts.addStretch(1)
        fill(texts, self.state, self.limits, spacing=0).addStretch(1)
        fill(QHBoxLayout(self), texts, self.stop_place, spacing=8)
        self.setVisible(False)

    def show_teleop(self, teleop: Teleop) -> None:
        """Shows the robot's limits; nothing on a robot without teleoperation."""
        self.setVisible(teleop.state is not TeleopState.UNKNOWN)
        set_text(self.state, f"Driving {teleop.state.value}")
        linear, angular = quantity(teleop.max_linear_mps, "m/s"), quantity(teleop.max_angular_rad_s, "rad/s")
        set_text(self.limits, f"at most {linear}, {angular}")
        self.setAccessibleName(f"Driving {teleop.state.value}, {self.limits.text()}")
