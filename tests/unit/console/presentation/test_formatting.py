import time
from datetime import UTC

import pytest

from console.presentation.formatting import (
    age,
    bit_rate,
    gibibytes,
    joined,
    plural,
    quantity,
    signed,
    wall_clock,
    with_component,
    without_component,
)


@pytest.mark.parametrize(
    ("age_ms", "text"),
    [
        (None, "-"),
        (0, "0 ms"),
        (999, "999 ms"),
        (1000, "1.0 s"),
        (59_900, "59.9 s"),
        (60_000, "1 min 00 s"),
        (125_000, "2 min 05 s"),
        (3_600_000, "1 h 00 min"),
        (11_520_000, "3 h 12 min"),
    ],
)
def test_ages(age_ms: int | None, text: str) -> None:
    assert age(age_ms) == text


def test_numbers_carry_their_unit() -> None:
    assert quantity(29.84, "fps") == "29.8 fps"
    assert quantity(2500.4, "kbit/s", 0) == "2500 kbit/s"
    assert quantity(None, "fps") == "-"
    assert gibibytes(3 << 30) == "3.0 GiB"
    assert gibibytes(None) == "-"


def test_a_direction_has_a_sign_and_rest_has_none_of_its_own() -> None:
    assert signed(0.5) == "+0.50"
    assert signed(-0.5) == "-0.50"
    assert signed(-0.001) == "+0.00"
    assert signed(None) == "-"


def test_counts() -> None:
    assert [plural(n, "viewer") for n in (0, 1, 2, None)] == [
        "0 viewers",
        "1 viewer",
        "2 viewers",
        "- viewers",
    ]


def test_empty_parts_leave_no_comma() -> None:
    assert joined("a", "", "b") == "a, b"


def test_a_time_of_day() -> None:
    assert wall_clock(1_795_302_000_999, UTC) == "2026-11-21 23:00:00 UTC"
    assert wall_clock(1_795_302_000_999).split()[2] in time.tzname


@pytest.mark.parametrize(
    ("component", "message", "after", "beside"),
    [
        ("odometry", "Odometry stopped coming", "Odometry stopped coming", "Odometry stopped coming"),
        ("drive: motor", "drive: motor: failed", "drive: motor: failed", "failed"),
        (
            "preview",
            "the preview service is gone",
            "the preview service is gone",
            "the preview service is gone",
        ),
        ("power", "the battery is low", "power: the battery is low", "the battery is low"),
        ("Drive", "drive: jammed", "drive: jammed", "jammed"),
    ],
)
def test_a_component_is_said_once(component: str, message: str, after: str, beside: str) -> None:
    assert with_component(component, message) == after
    assert without_component(component, message) == beside


@pytest.mark.parametrize(
    ("kbps", "text"), [(None, "-"), (850.4, "850 kbit/s"), (1000, "1.00 Mbit/s"), (2980, "2.98 Mbit/s")]
)
def test_a_bit_rate_for_people(kbps: float | None, text: str) -> None:
    assert bit_rate(kbps) == text


@pytest.mark.parametrize("unix_ms", [2**64 - 1, 2**63, 2**62, 253_402_300_800_000, -(2**63)])
def test_a_time_that_no_calendar_has(unix_ms: int) -> None:
    assert wall_clock(unix_ms, UTC) == wall_clock(unix_ms) == "-"
