"""How fast a copy goes, and when it ends."""

import pytest

from console.monitor.export_meter import ExportMeter, ExportRate


def test_the_first_reading_says_nothing() -> None:
    assert ExportMeter().read(10.0, 5, 100) == ExportRate()


def test_the_rate_is_that_of_the_newest_seconds() -> None:
    meter = ExportMeter()
    for tenths in range(0, 200, 2):
        meter.read(tenths / 10, 10 * tenths, 10_000)
    for tenths in range(200, 300, 2):
        rate = meter.read(tenths / 10, 2000 + 100 * (tenths - 200), 20_000)
    assert rate.bytes_per_s == pytest.approx(1000)
    assert rate.left_s == pytest.approx((20_000 - 11_800) / 1000)


def test_while_nothing_comes_the_end_is_not_known() -> None:
    meter = ExportMeter()
    meter.read(0.0, 50, 100)
    assert meter.read(1.0, 50, 100).left_s is None


def test_a_robot_that_sends_more_than_it_said_is_at_the_end() -> None:
    meter = ExportMeter()
    meter.read(0.0, 50, 100)
    assert meter.read(1.0, 150, 100).left_s == 0


def test_readings_are_due_five_times_a_second() -> None:
    meter = ExportMeter()
    assert meter.is_due(0.0)
    meter.read(0.0, 0, 1)
    assert not meter.is_due(0.1)
    assert meter.is_due(0.2)
