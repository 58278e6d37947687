"""Which parts of the cockpit are shown, by its size and by what the operator chose."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtWidgets import QWidget

from console.window.bottom_strip import BottomStrip
from console.window.plot import Plots
from console.window.side_panel import SidePanel
from console.window.top_bar import TopBar
from console.window.video_view import VideoView

_WIDE_PX: Final = 1100
"""From this width on, plots stand below the picture while the panel is open; else they are a tab."""
_LEAST_PLOTS_PX: Final = 64
_MOST_PLOTS_PX: Final = 170


@dataclass(frozen=True, slots=True)
class Parts:
    """What stands around the picture, and the picture, whose shape says what is left below it."""

    header: TopBar
    side: SidePanel
    plots: Plots
    strip: BottomStrip
    video: VideoView


class Arrangement:
    """Shows and hides the parts of a window.

    Args:
        window: has the size that counts.
        parts: of it.
    """

    def __init__(self, window: QWidget, parts: Parts) -> None:
        self._window = window
        self._parts = parts
        self._picture_only = False
        self.panel_open = True
        """Whether the operator has the side panel open; beside a picture alone it is hidden all the same."""

    def toggle_panel(self) -> None:
        """Opens or closes the side panel."""
        self.panel_open, self._picture_only = not self._parts.side.isVisible(), False
        self.arrange()

    def toggle_picture_only(self) -> None:
        """Leaves the window to the picture, and back; the place of STOP stays where a robot can be driven."""
        self._picture_only = not self._picture_only
        self.arrange()

    def end_picture_only(self) -> bool:
        """Returns to the whole window; False where it is there already."""
        if not self._picture_only:
            return False
        self.toggle_picture_only()
        return True

    def show_tab(self, number: int) -> None:
        """Shows a tab of the side panel, which is opened for it."""
        if not self._parts.side.isVisible():
            self.toggle_panel()
        self._parts.side.show_tab(number)

    def arrange(self) -> None:
        """Shows the parts that this size and the operator's choices call for."""
        parts, whole = self._parts, not self._picture_only
        panel = self.panel_open and whole
        parts.header.setVisible(whole)
        parts.side.setVisible(panel)
        parts.strip.show_preview(whole)
        parts.header.panel_button.setChecked(panel)
        below = panel and self._window.width() >= _WIDE_PX
        parts.side.show_plots_tab(not below)
        parts.plots.setVisible(below)
        if below:
            parts.plots.setFixedHeight(self._room_for_plots())

    def _room_for_plots(self) -> int:
        """Returns the height that the picture's shape leaves below it, within bounds."""
        parts = self._parts
        width = self._window.width() - parts.side.width()
        height = self._window.height() - parts.header.height() - parts.strip.height()
        left = height - width / parts.video.shape
        return round(max(_LEAST_PLOTS_PX, min(_MOST_PLOTS_PX, left)))
