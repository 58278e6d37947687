"""Theme: colours and shapes. The palette of Okabe and Ito is safe for colour-blind people, too."""

from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import QEvent, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPaintEvent, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from console.presentation.severity_style import SeverityStyle
from console.window.labels import PlainLabel

COLOURS: Final[Mapping[SeverityStyle, QColor]] = {
    SeverityStyle.GOOD: QColor("#009E73"),
    SeverityStyle.WARNING: QColor("#E69F00"),
    SeverityStyle.BAD: QColor("#D55E00"),
}
"""Bluish green, orange, vermillion. QUIET has no colour of its own."""
CURVE_ON_LIGHT: Final = QColor("#0072B2")
CURVE_ON_DARK: Final = QColor("#56B4E9")
PALETTE_CHANGES: Final = (QEvent.Type.ApplicationPaletteChange, QEvent.Type.PaletteChange)
_INK: Final = QColor("#000000")
"""Ink on a coloured shape: black has a contrast (WCAG 2.1, 1.4.3) of 5 or more on all three."""
_TINT: Final = 0.16
_DIM: Final = 0.30
_DISABLED: Final = 0.45
_MIDDLE_GREY: Final = 128
_ACTIVE: Final = QPalette.ColorGroup.Active
_TEXTS: Final = (
    (QPalette.ColorRole.WindowText, QPalette.ColorRole.Window),
    (QPalette.ColorRole.ButtonText, QPalette.ColorRole.Button),
    (QPalette.ColorRole.Text, QPalette.ColorRole.Base),
)
"""Roles of texts, each with that of the ground below it."""


def is_dark(palette: QPalette) -> bool:
    """Whether the palette has light text on a dark ground."""
    return palette.color(QPalette.ColorRole.Window).lightness() < _MIDDLE_GREY


def mixed(one: QColor, other: QColor, share: float) -> QColor:
    """Returns a mix of two colours with `share` (0 to 1) of the other one."""
    mix = [
        a + (b - a) * share
        for a, b in zip(one.getRgbF()[:3], other.getRgbF()[:3], strict=True)  # type: ignore[index]
    ]
    return QColor.fromRgbF(*mix)


def tinted_ground(palette: QPalette, style: SeverityStyle) -> QColor:
    """Returns the ground behind a line of this style."""
    ground = palette.color(QPalette.ColorRole.Window)
    colour = COLOURS.get(style)
    return mixed(ground, colour, _TINT) if colour and style is not SeverityStyle.GOOD else ground


def dim_text(palette: QPalette) -> QColor:
    """Returns the colour of secondary text: nearer to the ground, and still easy to read."""
    text, ground = palette.color(QPalette.ColorRole.WindowText), palette.color(QPalette.ColorRole.Window)
    return mixed(text, ground, _DIM)


def with_readable_disabled(palette: QPalette) -> QPalette:
    """Returns a palette in which what is disabled is dim, but can be read: Qt's own can't on dark."""
    changed = QPalette(palette)
    for text, ground in _TEXTS:
        dim = mixed(palette.color(_ACTIVE, text), palette.color(_ACTIVE, ground), _DISABLED)
        if palette.color(QPalette.ColorGroup.Disabled, text) != dim:
            changed.setColor(QPalette.ColorGroup.Disabled, text, dim)
    return changed


COCKPIT: Final = with_readable_disabled(QPalette(QColor("#22262a")))
"""Palette of what surrounds the picture, on a light desktop, too: the picture is what is looked at."""


class DimLabel(PlainLabel):
    """Secondary text, in the desktop's light or dark colours, also when these change."""

    def __init__(self, text: str = "") -> None:
        super().__init__(text)
        self._colour()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        """Follows the desktop from light to dark."""
        super().changeEvent(event)
        if event.type() in (*PALETTE_CHANGES, QEvent.Type.ParentChange):
            self._colour()

    def _colour(self) -> None:
        parent = self.parentWidget()
        around = parent.palette() if parent else QGuiApplication.palette()
        palette, dim = self.palette(), dim_text(around)
        if palette.color(self.foregroundRole()) != dim:
            palette.setColor(self.foregroundRole(), dim)
            self.setPalette(palette)


class Marker(QWidget):
    """A small shape: a disc with a tick, a triangle with "!", a square with a cross, an empty ring."""

    def __init__(self) -> None:
        super().__init__()
        self.severity = SeverityStyle.QUIET
        """The style shown."""
        self._blank = False
        side = self.fontMetrics().height()
        self.setFixedSize(side, side)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)

    def show_style(self, style: SeverityStyle, *, blank: bool = False) -> None:
        """Changes the shape; a blank one keeps its place."""
        if (style, blank) != (self.severity, self._blank):
            self.severity, self._blank = style, blank
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints the shape."""
        if self._blank:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        box = QRectF(self.rect()).adjusted(1.5, 1.5, -1.5, -1.5)
        draw_shape(painter, box, self.severity, self.palette())


def draw_shape(painter: QPainter, box: QRectF, style: SeverityStyle, palette: QPalette) -> None:
    """Draws the shape of a style, as large as the box."""
    outline = palette.color(QPalette.ColorRole.WindowText)
    painter.setPen(QPen(outline, 1))
    painter.setBrush(COLOURS.get(style, QColor(Qt.GlobalColor.transparent)))
    ink = QPen(_INK, max(1.5, box.width() / 7), Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)

    def at(x: float, y: float) -> QPointF:
        return QPointF(box.left() + x * box.width(), box.top() + y * box.height())

    match style:
        case SeverityStyle.GOOD:
            painter.drawEllipse(box)
            painter.setPen(ink)
            painter.drawPolyline(QPolygonF([at(0.28, 0.52), at(0.45, 0.70), at(0.74, 0.32)]))
        case SeverityStyle.WARNING:
            painter.drawPolygon(QPolygonF([at(0.5, 0.0), at(1.0, 0.95), at(0.0, 0.95)]))
            painter.setPen(ink)
            painter.drawLine(at(0.5, 0.36), at(0.5, 0.62))
            painter.drawPoint(at(0.5, 0.81))
        case SeverityStyle.BAD:
            painter.drawRect(box)
            painter.setPen(ink)
            painter.drawLine(at(0.28, 0.28), at(0.72, 0.72))
            painter.drawLine(at(0.72, 0.28), at(0.28, 0.72))
        case SeverityStyle.QUIET:
            painter.setPen(QPen(dim_text(palette), 1.5))
            painter.drawEllipse(box.adjusted(1.5, 1.5, -1.5, -1.5))
