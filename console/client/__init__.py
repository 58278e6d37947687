"""Client library of a robot's gateway, blocking or with asyncio; needs neither ROS nor GStreamer.

    from console.client import GatewayClient, PreviewProfile

    with GatewayClient("robot.local") as robot:
        status = robot.status()
        print(status.health.summary, status.odometry.linear_speed_mps)

Every call has a deadline, is retried for a moment while the robot is unreachable, and either returns a frozen
value of `console.client.results` or raises a `GatewayError` that says what to do.
"""

from console.client.aio import AsyncGatewayClient
from console.client.blocking import GatewayClient
from console.client.clock import Clock, Offset
from console.client.drive_session import DriveOptions, DriveSession
from console.client.errors import (
    Cancelled,
    DeadlineExceeded,
    GatewayError,
    GatewayFailed,
    InvalidRequest,
    NotAllowed,
    NotTrusted,
    Overloaded,
    Refused,
    Unreachable,
    Unsupported,
)
from console.client.exporting import ExportedRecording, ExportOptions, ExportProgress
from console.client.mapping.methods import DesiredPreview
from console.client.options import Backoff, ClientOptions
from console.client.results import (
    Camera,
    CameraState,
    CaughtUp,
    CloudState,
    CloudStatus,
    DriveInhibit,
    DrivePhase,
    DriveState,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    GatewayInfo,
    KeyFrameAnswer,
    OverlaySnapshot,
    PictureDelivery,
    PictureReport,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    Recording,
    RecordingCopyState,
    RecordingStatus,
    RobotStopped,
    StopLatch,
    Supervision,
    SystemStatus,
    WatchedStatus,
)
from console.client.streams import Outage
from console.client.uploading import UploadProgress
from console.credentials import Credentials
from console.target import DEFAULT_TARGET, parse_target
