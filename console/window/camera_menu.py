"""Button with the camera's name; its menu lists the robot's cameras. Absent where there is no choice."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QMenu, QToolButton

from console.client import Camera, CameraState
from console.window.labels import plain_tip, set_text, set_tool_tip

_WIDEST_PX = 140
_MARKS: Final = {CameraState.FAILED: "does not work", CameraState.STARTING: "starting"}


class CameraMenu(QToolButton):
    """Shows the wanted camera, and signals the choice of another one."""

    chosen = Signal(str)
    """A camera was chosen; with its name."""

    def __init__(self) -> None:
        super().__init__()
        self._cameras: Sequence[Camera] = ()
        self._wanted = ""
        self.cameras = QMenu(self)
        self.cameras.setToolTipsVisible(True)
        self.cameras.aboutToShow.connect(self.fill)
        self.setMenu(self.cameras)
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMaximumWidth(_WIDEST_PX)
        self.setVisible(False)

    def show_cameras(self, cameras: Sequence[Camera], wanted: str) -> None:
        """Shows the robot's cameras; of less than two there is nothing to choose."""
        if (cameras, wanted) == (self._cameras, self._wanted):
            return
        self._cameras, self._wanted = cameras, wanted
        self.setVisible(len(cameras) > 1)
        set_text(self, _literal(wanted or "camera"))
        set_tool_tip(self, f"Camera {wanted}: others (Key V: the next one)")
        self.setAccessibleName(f"Camera {wanted}, choose another one")

    def fill(self) -> None:
        """Lists the cameras of this moment."""
        self.cameras.clear()
        for camera in self._cameras:
            mark = _MARKS.get(camera.state, "")
            action = self.cameras.addAction(_literal(f"{camera.name}  ({mark})" if mark else camera.name))
            action.setCheckable(True)
            action.setChecked(camera.name == self._wanted)
            action.setToolTip(plain_tip(camera.error))
            action.triggered.connect(partial(self._choose, camera.name))

    def _choose(self, name: str, _checked: bool = False) -> None:
        self.chosen.emit(name)


def _literal(text: str) -> str:
    """Returns a text for a button or a menu, which take & for the mark of a mnemonic."""
    return text.replace("&", "&&")
