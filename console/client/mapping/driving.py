"""The messages of driving."""

from dataclasses import dataclass
from typing import Final

from console.client import results
from console.client.mapping import enums
from console.client.mapping.reader import read
from omniseer.gateway.v1 import robot_gateway_pb2, teleop_pb2

_MAX_CLIENT_NAME: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveCommand:
    """A driver's command; instants are ns of the robot's monotonic clock, 0 where they are not known."""

    sequence: int
    held: bool
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    wz_rad_s: float = 0.0
    echo_monotonic_ns: int = 0
    picture_monotonic_ns: int = 0
    valid_until_monotonic_ns: int = 0
    input_device: str = ""


def open_request(client_name: str, supervision: results.Supervision, *, take_over: bool) -> bytes:
    """Returns the first request of a session's first lane."""
    number = enums.number(supervision, teleop_pb2.Supervision.DESCRIPTOR)
    opening = teleop_pb2.DriveOpen(
        client_name=client_name[:_MAX_CLIENT_NAME], take_over=take_over, supervision=number
    )
    return teleop_pb2.DriveRequest(open=opening).SerializeToString()


def join_request(client_name: str, session_id: str) -> bytes:
    """Returns the first request of another lane."""
    opening = teleop_pb2.DriveOpen(client_name=client_name[:_MAX_CLIENT_NAME], session_id=session_id)
    return teleop_pb2.DriveRequest(open=opening).SerializeToString()


def command_request(command: DriveCommand) -> bytes:
    """Returns the request of a command."""
    values = {name: getattr(command, name) for name in DriveCommand.__slots__}
    return teleop_pb2.DriveRequest(command=teleop_pb2.DriveCommand(**values)).SerializeToString()


def stop_request(request_id: str, reason: str) -> bytes:
    """Returns the request of StopRobot."""
    return teleop_pb2.StopRobotRequest(reason=reason, request_id=request_id).SerializeToString()


def reset_request(stop_id: int) -> bytes:
    """Returns the request of ResetStop."""
    return teleop_pb2.ResetStopRequest(stop_id=stop_id).SerializeToString()


def enabled_request(enabled: bool) -> bytes:
    """Returns the request of SetTeleopEnabled."""
    return robot_gateway_pb2.SetTeleopEnabledRequest(enabled=enabled).SerializeToString()


def velocity_request(vx_mps: float, vy_mps: float, wz_rad_s: float) -> bytes:
    """Returns the request of SendTeleopCommand."""
    return robot_gateway_pb2.SendTeleopCommandRequest(
        linear_x_mps=vx_mps, linear_y_mps=vy_mps, angular_z_rad_s=wz_rad_s
    ).SerializeToString()


def drive_item(message: teleop_pb2.DriveResponse) -> results.DriveOpened | results.DriveState | None:
    """Returns what a lane has sent; None for an item of a newer gateway."""
    match message.WhichOneof("message"):
        case "opened":
            return read(results.DriveOpened, message.opened)
        case "state":
            return read(results.DriveState, message.state)
        case _:
            return None
