"""Position and orientation as messages of the contract."""

from gateway.rpc.mapping.enums import FIXES
from gateway.rpc.mapping.freshness import freshness_fields
from gateway.status.freshness import Sample
from gateway.status.values import Orientation, Position
from omniseer.gateway.v1 import pose_pb2 as pb


def position_status(sample: Sample[Position]) -> pb.PositionStatus:
    """Returns the position; what is not known is unset."""
    value = sample.value
    if value is None:
        return pb.PositionStatus()
    return pb.PositionStatus(
        **freshness_fields(sample.freshness),
        fix=FIXES[value.fix] if value.fix else pb.FIX_STATUS_UNSPECIFIED,
        latitude_deg=value.latitude_deg,
        longitude_deg=value.longitude_deg,
        altitude_m=value.altitude_m,
        horizontal_accuracy_m=value.horizontal_accuracy_m,
        vertical_accuracy_m=value.vertical_accuracy_m,
    )


def orientation_status(sample: Sample[Orientation]) -> pb.OrientationStatus:
    """Returns the angles; unset where they are not known."""
    value = sample.value
    if value is None:
        return pb.OrientationStatus()
    return pb.OrientationStatus(
        **freshness_fields(sample.freshness),
        roll_deg=value.roll_deg,
        pitch_deg=value.pitch_deg,
        yaw_deg=value.yaw_deg,
    )
