"""Texts of the plots: none overprints another, in any width that a layout gives."""

import pytest
from PySide6.QtGui import QFont, QFontMetricsF

from console.monitor.history import METRICS, Metric
from console.window.plot import Plot

BIT_RATE = METRICS[2]


@pytest.mark.parametrize("metric", METRICS, ids=lambda metric: metric.title)
@pytest.mark.parametrize("value", [0.0, 8.2, 2704.0, 99_999.0])
def test_value_and_end_of_the_scale_never_touch(metric: Metric, value: float) -> None:
    plot = Plot(metric)
    plot.show_series([value])
    least = plot.minimumSizeHint().width()
    shown = 0
    for width in range(least, 300):
        (title, _), (left, right) = plot.texts(width)
        assert left == plot.value_text, "the value is never cut"
        assert advance(plot, title) <= width
        assert advance(plot, left, bold=True) + advance(plot, right) < width
        shown += bool(right)
    assert shown, "where there is room, the scale has its end"


def test_a_bit_rate_is_readable_for_people() -> None:
    plot = Plot(BIT_RATE)
    plot.show_series([2704.0])
    assert (plot.value_text, plot.top_text) == ("2.70 Mbit/s", "max 3.00 Mbit/s")


def advance(plot: Plot, text: str, *, bold: bool = False) -> float:
    font = QFont(plot.font())
    font.setPointSizeF(font.pointSizeF() * 0.85)
    font.setBold(bold)
    return QFontMetricsF(font).horizontalAdvance(text)
