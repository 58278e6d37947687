"""Talks to a robot's gateway from Python, blocking or with asyncio; knows neither ROS nor GStreamer.

    from console.client import GatewayClient, PreviewProfile

    with GatewayClient("robot.local") as robot:
        status = robot.status()
        print(status.health.summary, status.odometry.linear_speed_mps)

Every call has a deadline, is tried again for a moment while the robot can't be reached, and either returns a
frozen value of `console.client.results` or raises a `GatewayError` that says what to do.
"""

from console.client.aio import AsyncGatewayClient
from console.client.blocking import GatewayClient
from console.client.clock import Clock, Offset
from console.client.credentials import Credentials
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
from console.client.options import Backoff, ClientOptions
from console.client.results import (
    CaughtUp,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    GatewayInfo,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    SystemStatus,
    WatchedStatus,
)
from console.client.streams import Outage
from console.client.target import DEFAULT_TARGET, parse_target

__all__ = [
    "DEFAULT_TARGET",
    "AsyncGatewayClient",
    "Backoff",
    "Cancelled",
    "CaughtUp",
    "ClientOptions",
    "Clock",
    "Credentials",
    "DeadlineExceeded",
    "Event",
    "EventGap",
    "EventPosition",
    "FaultSeverity",
    "GatewayClient",
    "GatewayError",
    "GatewayFailed",
    "GatewayInfo",
    "InvalidRequest",
    "NotAllowed",
    "NotTrusted",
    "Offset",
    "Outage",
    "OverlaySnapshot",
    "Overloaded",
    "PreviewChange",
    "PreviewProfile",
    "PreviewState",
    "PreviewStatus",
    "Refused",
    "SystemStatus",
    "Unreachable",
    "Unsupported",
    "WatchedStatus",
    "parse_target",
]
