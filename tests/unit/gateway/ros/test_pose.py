"""NavSatFix and Imu: what is a position and an orientation, and what is none."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.config import SourceSettings
from gateway.ros.readers import reader_for
from gateway.status.values import Fix, Orientation, Position

FIX = SourceSettings(kind="position", topic="/f", type="sensor_msgs/msg/NavSatFix")
IMU = SourceSettings(kind="orientation", topic="/i", type="sensor_msgs/msg/Imu")
APPROXIMATED = 1
NOWHERE = (None,) * 5


def position(
    latitude: float = 48.12345678,
    longitude: float = 11.5,
    *,
    status: int = 0,
    altitude: float = 520.126,
    variances: tuple[float, float, float] = (9.0, 16.0, 4.0),
    covariance_type: int = APPROXIMATED,
) -> Position:
    east, north, up = variances
    message = SimpleNamespace(
        status=SimpleNamespace(status=status),
        latitude=latitude,
        longitude=longitude,
        altitude=altitude,
        position_covariance=[east, 0, 0, 0, north, 0, 0, 0, up],
        position_covariance_type=covariance_type,
    )
    value = reader_for(FIX)(message, FIX)
    assert isinstance(value, Position)
    return value


def orientation(x: float, y: float, z: float, w: float, first: float = 0.0) -> Orientation:
    message = SimpleNamespace(
        orientation=SimpleNamespace(x=x, y=y, z=z, w=w), orientation_covariance=[first, *[0.0] * 8]
    )
    value = reader_for(IMU)(message, IMU)
    assert isinstance(value, Orientation)
    return value


def angles(value: Orientation) -> tuple[Any, ...]:
    return value.roll_deg, value.pitch_deg, value.yaw_deg


def about(axis: int, degrees: float) -> Orientation:
    """A rotation about one axis."""
    parts = [0.0, 0.0, 0.0, math.cos(math.radians(degrees) / 2)]
    parts[axis] = math.sin(math.radians(degrees) / 2)
    return orientation(*parts)


def test_a_position_with_its_accuracy() -> None:
    assert position() == Position(Fix.FIX, 48.1234568, 11.5, 520.13, 5.0, 2.0)


@pytest.mark.parametrize(
    ("status", "fix"), [(0, Fix.FIX), (1, Fix.SBAS), (2, Fix.GBAS), (-2, None), (9, None)]
)
def test_every_kind_of_fix(status: int, fix: Fix | None) -> None:
    assert position(status=status).fix is fix
    assert position(status=status).latitude_deg is not None


@pytest.mark.parametrize(
    "wrong",
    [
        {"status": -1},
        {"latitude": math.nan},
        {"longitude": math.inf},
        {"latitude": 90.1},
        {"longitude": -180.1},
    ],
)
def test_no_position(wrong: dict[str, Any]) -> None:
    value = position(**wrong)
    assert (value.latitude_deg, value.longitude_deg, value.altitude_m) == NOWHERE[:3]
    assert (value.horizontal_accuracy_m, value.vertical_accuracy_m) == NOWHERE[:2]


def test_what_the_receiver_does_not_know() -> None:
    assert position(altitude=math.nan).altitude_m is None
    unknown = position(covariance_type=0)
    assert (unknown.horizontal_accuracy_m, unknown.vertical_accuracy_m) == (None, None)
    partly = position(variances=(9.0, -1.0, math.nan))
    assert (partly.horizontal_accuracy_m, partly.vertical_accuracy_m) == (None, None)
    assert position(variances=(9.0, 16.0, math.nan)).horizontal_accuracy_m == 5.0


def test_each_axis() -> None:
    assert angles(orientation(0, 0, 0, 1)) == (0.0, 0.0, 0.0)
    assert angles(about(0, 30)) == (30.0, 0.0, 0.0)
    assert angles(about(1, -20)) == (0.0, -20.0, 0.0)
    assert angles(about(2, 170)) == (0.0, 0.0, 170.0)
    assert angles(orientation(0, 0, 0, -1)) == (0.0, 0.0, 0.0), "the same rotation"


def test_a_nose_straight_down_is_no_error() -> None:
    half = math.sqrt(0.5)
    assert orientation(0, half + 1e-9, 0, half).pitch_deg == 90.0


@pytest.mark.parametrize(
    "parts",
    [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1), (1, 1, 1, 1), (0, 0, 0, 0.5), (1e308,) * 4],
)
def test_what_is_no_rotation(parts: tuple[float, ...]) -> None:
    assert angles(orientation(*parts)) == (None, None, None)


def test_no_estimate() -> None:
    assert angles(orientation(0, 0, 0, 1, first=-1.0)) == (None, None, None)
    assert orientation(0, 0, 0, 1, first=-1.0).tilt_deg is None


@given(st.floats(-180, 180), st.floats(-180, 180))
def test_turning_does_not_tilt_and_rolling_does(roll: float, yaw: float) -> None:
    assert about(2, yaw).tilt_deg == pytest.approx(0.0, abs=0.01)
    assert about(0, roll).tilt_deg == pytest.approx(abs(roll), abs=0.11)
