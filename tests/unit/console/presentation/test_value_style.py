"""A fresh value may be a bad one: colours by value."""

from collections.abc import Callable
from typing import Final

import pytest

from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows
from console.presentation.value_style import (
    BATTERY_FAULTS,
    CHARGE_PERCENT,
    COMPUTE_FAULTS,
    COMPUTER_BATTERY_FAULTS,
    NETWORK_FAULTS,
    ORIENTATION_FAULTS,
    WIFI_DBM,
    Judgement,
)
from gateway.status.faults.known import known_faults
from gateway.status.sources import BATTERY, ORIENTATION
from omniseer.gateway.v1 import system_status_pb2
from tests.support.snapshots import snapshot

GOOD, WARNING, BAD, QUIET = (
    SeverityStyle.GOOD,
    SeverityStyle.WARNING,
    SeverityStyle.BAD,
    SeverityStyle.QUIET,
)
Change = Callable[[system_status_pb2.SystemStatus], object]


def row(label: str, change: Change, *, compact: bool = True, outdated: bool = False) -> Row:
    taken = snapshot(lambda made: change(made.status))
    view = View(taken.status, compact=compact, detections=taken.detections, outdated=outdated)
    return {each.label: each for each in table_rows(view)}[label]


def charge(percent: float, *, charging: bool = False) -> Change:
    def change(status: system_status_pb2.SystemStatus) -> None:
        battery = status.platform.power.lipo_battery
        battery.percentage, battery.charging, battery.charging_available = percent, charging, True

    return change


@pytest.mark.parametrize(
    ("percent", "style", "mark"),
    [(78, GOOD, "fresh"), (21, GOOD, "fresh"), (20, WARNING, "LOW"), (12, WARNING, "LOW"), (10, BAD, "LOW")],
)
@pytest.mark.parametrize("compact", [True, False])
def test_a_low_battery_is_not_green(percent: float, style: SeverityStyle, mark: str, compact: bool) -> None:
    found = row("Battery" if compact else "battery", charge(percent), compact=compact)
    assert (found.style, found.mark) == (style, mark)


def test_a_battery_that_is_being_charged_is_no_error() -> None:
    assert row("Battery", charge(5, charging=True)).style is WARNING


def test_a_battery_that_is_not_there_is_neither_good_nor_bad() -> None:
    def change(status: system_status_pb2.SystemStatus) -> None:
        status.platform.power.lipo_battery.present = False

    assert row("Battery", change).style is QUIET


def test_stale_comes_before_the_value() -> None:
    found = row("Battery", charge(5), outdated=True)
    assert (found.style, found.mark) == (WARNING, "STALE")


def test_an_unknown_value_is_not_judged() -> None:
    assert WIFI_DBM.judge(None) == Judgement(GOOD, "")


def test_low_values_are_the_bad_ones_where_the_limits_run_downwards() -> None:
    assert [WIFI_DBM.judge(dbm).style for dbm in (-60, -75, -85)] == [GOOD, WARNING, BAD]
    assert CHARGE_PERCENT.judge(float("nan")).style is GOOD


def test_a_computer_is_as_bad_as_its_worst_value() -> None:
    def change(status: system_status_pb2.SystemStatus) -> None:
        compute = status.platform.compute
        compute.available, compute.cpu_percent = True, 20
        compute.cpu_temperature_available, compute.cpu_temperature_c = True, 96
        compute.disk_available, compute.disk_used_percent = True, 96

    found = row("Computer", change)
    assert (found.style, found.mark) == (BAD, "HOT")


def test_a_network_that_is_down_is_an_error() -> None:
    def change(status: system_status_pb2.SystemStatus) -> None:
        status.platform.network.available, status.platform.network.connected = True, False

    found = row("Network", change)
    assert (found.style, found.mark) == (BAD, "DOWN")


def test_lost_packets_are_not_green() -> None:
    def change(status: system_status_pb2.SystemStatus) -> None:
        measured = status.preview.measured
        measured.available, measured.fps, measured.worst_loss_percent = True, 30, 3.0

    assert row("Video", change).mark == "LOSSY"


def with_fault(fault_id: str, *, active: bool = True, severity: int = 2) -> Change:
    """A robot whose values are good, by its own limits a fault."""

    def change(status: system_status_pb2.SystemStatus) -> None:
        charge(60)(status)
        status.platform.power.onboard_battery.CopyFrom(status.platform.power.lipo_battery)
        compute, network = status.platform.compute, status.platform.network
        compute.available, compute.cpu_percent = True, 20
        network.available, network.connected = True, True
        status.orientation.available = True
        angles = status.orientation
        angles.roll_deg, angles.pitch_deg, angles.yaw_deg = 20, 0, 0
        status.faults.add(id=fault_id, severity=severity, active=active)

    return change


PARTS: Final = {
    "Battery": BATTERY_FAULTS,
    "Computer battery": COMPUTER_BATTERY_FAULTS,
    "Computer": COMPUTE_FAULTS,
    "Network": NETWORK_FAULTS,
    "Attitude": ORIENTATION_FAULTS,
}


@pytest.mark.parametrize(
    ("label", "fault_id", "word"),
    [(label, *own) for label, faults in PARTS.items() for own in faults.items()],
)
def test_no_tick_stands_beside_a_part_with_a_fault_by_the_robots_own_limits(
    label: str, fault_id: str, word: str
) -> None:
    found = row(label, with_fault(fault_id))
    assert (found.style, found.mark) == (WARNING, word)
    assert row(label, with_fault(fault_id, severity=3)).style is BAD
    assert row(label, with_fault(fault_id, active=False)).style is GOOD
    assert row(label, with_fault("number.motor.above")).style is GOOD, "another part's"


def test_a_part_that_is_worse_than_its_fault_stays_so() -> None:
    def change(status: system_status_pb2.SystemStatus) -> None:
        charge(5)(status)
        status.faults.add(id="battery.low", severity=2, active=True)

    assert row("Battery", change).style is BAD


def test_the_faults_of_parts_are_those_of_a_gateway() -> None:
    known = set(known_faults([BATTERY, ORIENTATION]))
    assert {fault_id for faults in PARTS.values() for fault_id in faults} <= known
