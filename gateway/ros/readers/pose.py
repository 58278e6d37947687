"""Where the robot is and how it stands: sensor_msgs/msg/NavSatFix and sensor_msgs/msg/Imu."""

import math
from typing import Any, Final

from gateway.config import SourceSettings
from gateway.ros.readers.plain import clamp, finite
from gateway.ros.readers.registry import reads
from gateway.status.sources import ORIENTATION, POSITION
from gateway.status.values import Fix, Orientation, Position

# sensor_msgs/NavSatStatus: NO_FIX = -1, FIX = 0, SBAS_FIX = 1, GBAS_FIX = 2; UNKNOWN = -2.
_FIXES: Final = {-1: Fix.NONE, 0: Fix.FIX, 1: Fix.SBAS, 2: Fix.GBAS}
# sensor_msgs/NavSatFix: COVARIANCE_TYPE_UNKNOWN.
_COVARIANCE_UNKNOWN: Final = 0
# 1e-7 degrees are about 1 cm: receivers resolve no less, and noise below it is no change of the status.
_DEGREE_DIGITS: Final = 7
_METRE_DIGITS: Final = 2
_ANGLE_DIGITS: Final = 1
# A quaternion further off length 1 is no rounding, but no rotation.
_LENGTH_TOLERANCE: Final = 0.1
# sensor_msgs/Imu: element 0 of the covariance is -1 if the sensor has no estimate.
_NO_ESTIMATE: Final = -1

_NO_ORIENTATION: Final = Orientation(None, None, None)


@reads("sensor_msgs/msg/NavSatFix", POSITION)
def from_nav_sat_fix(message: Any, _source: SourceSettings) -> Position:
    """Returns the position; unknown without a fix, and where the numbers are none of the earth's."""
    fix = _FIXES.get(int(message.status.status))
    latitude, longitude = finite(message.latitude), finite(message.longitude)
    if fix is Fix.NONE or latitude is None or longitude is None or abs(latitude) > 90 or abs(longitude) > 180:
        return Position(fix, None, None, None, None, None)
    altitude = finite(message.altitude)
    known = int(message.position_covariance_type) != _COVARIANCE_UNKNOWN
    # Row-major, east, north, up.
    east, north, up = (message.position_covariance[index] for index in (0, 4, 8))
    return Position(
        fix,
        round(latitude, _DEGREE_DIGITS),
        round(longitude, _DEGREE_DIGITS),
        None if altitude is None else round(altitude, _METRE_DIGITS),
        _deviation(east, north) if known else None,
        _deviation(up) if known else None,
    )


@reads("sensor_msgs/msg/Imu", ORIENTATION)
def from_imu(message: Any, _source: SourceSettings) -> Orientation:
    """Returns roll, pitch and yaw; unknown without an estimate, or if the quaternion is no rotation."""
    if message.orientation_covariance[0] == _NO_ESTIMATE:
        return _NO_ORIENTATION
    rotation = message.orientation
    x, y, z, w = (float(part) for part in (rotation.x, rotation.y, rotation.z, rotation.w))
    length = math.hypot(x, y, z, w)
    # Written so that NaN is refused, too.
    if not abs(length - 1) <= _LENGTH_TOLERANCE:
        return _NO_ORIENTATION
    x, y, z, w = x / length, y / length, z / length, w / length
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(clamp(-1.0, 2 * (w * y - z * x), 1.0))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return Orientation(_degrees(roll), _degrees(pitch), _degrees(yaw))


def _deviation(*variances: Any) -> float | None:
    """Returns the root of the sum of variances; None if one is not known."""
    known = [value for variance in variances if (value := finite(variance)) is not None and value >= 0]
    return round(math.sqrt(sum(known)), _METRE_DIGITS) if len(known) == len(variances) else None


def _degrees(angle_rad: float) -> float:
    # Adding zero turns -0.0 into 0.0.
    return round(math.degrees(angle_rad), _ANGLE_DIGITS) + 0.0
