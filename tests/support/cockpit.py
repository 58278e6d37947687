"""A robot for the cockpit: a gateway double that streams, and before it a real preview of real footage."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from omniseer.gateway.v1 import preview_pb2, recording_pb2, value_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.gateway_double import StreamingGatewayDouble, serving
from tests.support.running_preview import RunningPreview

PICTURE = (1280, 720)
_SOURCE = "videotestsrc is-live=true pattern=smpte ! video/x-raw,width=1280,height=720,framerate=15/1"


@dataclass
class CockpitRobot:
    """What the window talks to.

    Args:
        gateway: its answers may be changed.
        target: its address.
    """

    gateway: StreamingGatewayDouble
    target: str


@contextmanager
def resting_robot() -> Iterator[CockpitRobot]:
    """A robot that drives a curve; its preview is off."""
    double = StreamingGatewayDouble()
    _fill(double)
    with serving(double) as port:
        yield CockpitRobot(double, f"127.0.0.1:{port}")


@contextmanager
def seeing_robot(directory: Path) -> Iterator[CockpitRobot]:
    """The same robot with 16:9 video and two boxes."""
    double = StreamingGatewayDouble()
    _fill(double)
    profile = {"width_px": PICTURE[0], "height_px": PICTURE[1], "fps": 15, "bitrate_kbps": 2000}
    settings = {"source": {"kind": "gst", "description": _SOURCE}, "profiles": {"balanced": profile}}
    with RunningPreview(directory, settings) as preview, serving(double) as port:
        preview.enable()
        preview.running()
        shown = double.status.preview
        shown.state, shown.profile = states.PREVIEW_RUNNING, preview_pb2.PREVIEW_PROFILE_BALANCED
        shown.endpoint.host, shown.endpoint.port, shown.endpoint.latency_ms = "127.0.0.1", preview.port, 20
        shown.endpoint.transport = preview_pb2.STREAM_TRANSPORT_SRT
        shown.endpoint.container = preview_pb2.STREAM_CONTAINER_MPEG_TS
        yield CockpitRobot(double, f"127.0.0.1:{port}")


def _fill(double: StreamingGatewayDouble) -> None:
    status = double.status
    platform, preview = status.platform, status.preview
    battery, compute, network = platform.power.lipo_battery, platform.compute, platform.network
    battery.voltage, battery.voltage_available = 12.4, True
    compute.available, compute.cpu_percent, compute.ram_used_percent = True, 41, 37
    compute.cpu_temperature_available, compute.cpu_temperature_c = True, 58
    network.available, network.connected, network.interface_name = True, True, "wlan0"
    network.wifi_signal_available, network.wifi_signal_dbm = True, -58
    status.mission.available, status.mission.mode = True, "manual"
    preview.encoder.name = preview.encoder.wanted = "x264"
    preview.video.width_px, preview.video.height_px, preview.video.fps = *PICTURE, 15
    measured = preview.measured
    measured.available, measured.fps, measured.bitrate_kbps, measured.viewer_count = True, 14.9, 2704, 1
    measured.worst_rtt_ms, measured.worst_loss_percent, measured.worst_picture_age_ms = 8.2, 0.4, 118
    found = double.overlay.detections
    found.available, found.source_width_px, found.source_height_px = True, *PICTURE
    found.detection_count = 2
    for name, x in (("person", 640), ("parcel beside the lift", 1250)):
        found.detections.add(
            class_name=name,
            score=0.9,
            bbox_center_x_px=x,
            bbox_center_y_px=400,
            bbox_width_px=60,
            bbox_height_px=200,
        )


def with_teleop(double: StreamingGatewayDouble) -> None:
    """Makes it a robot that accepts velocity commands."""
    teleop = double.status.teleop
    teleop.state, teleop.enabled = states.TELEOP_ENABLED, True
    teleop.max_linear_mps, teleop.max_angular_rad_s = 0.8, 1.5


def with_tiles(double: StreamingGatewayDouble) -> None:
    """Makes it a robot with six values over the picture: good, bad, old and missing ones."""
    status = double.status
    numbers = (
        ("left_motor", "Left motor temperature", 96.0, "\u00b0C", 1, value_pb2.NUMBER_LEVEL_ERROR_HIGH),
        ("cell_3", "Cell 3", 3.31, "V", 2, value_pb2.NUMBER_LEVEL_WARNING_LOW),
        ("co2", "CO2", 412.0, "ppm", 0, value_pb2.NUMBER_LEVEL_GOOD),
    )
    for label, title, value, unit, decimals, level in numbers:
        status.numbers.add(
            label=label,
            title=title,
            available=True,
            age_ms=40,
            value=value,
            unit=unit,
            decimals=decimals,
            level=level,
            tile=True,
        )
    status.numbers.add(label="winch", title="Winch load", unit="kg", tile=True)
    old = status.numbers.add(label="depth", title="Depth", available=True, stale=True, age_ms=125_000)
    old.value, old.unit, old.decimals, old.tile = 1.25, "m", 2, True
    status.texts.add(
        label="gripper",
        title="Gripper",
        available=True,
        age_ms=400_000,
        text="holding parcel 12, waiting for the lift",
        level=value_pb2.TEXT_LEVEL_GOOD,
        tile=True,
    )
    for name in ("left_motor", "cell_3"):
        status.sources.add(name=f"number.{name}")
    status.sources.add(name="text.gripper")
    for name in ("co2", "winch", "depth"):
        status.sources.add(name=f"number.{name}")


def with_recorder(double: StreamingGatewayDouble) -> None:
    """Makes it a robot that records, with little room left."""
    recording = double.status.recording
    recording.state, recording.recording_id = recording_pb2.RECORDER_STATE_RECORDING, "one"
    recording.label, recording.preset, recording.video = "lap 12, with the new wheels", "driving", True
    recording.elapsed_ms, recording.size, recording.bytes_per_s = 4_265_000, 1_340_000_000, 314_000
    recording.room_bytes, recording.room_s, recording.ring_s = 770_000_000, 2452, 60
    recording.presets.add(
        name="driving",
        description="motion and state, without images",
        with_video=True,
        bytes_per_minute=18_800_000,
        in_ring=True,
    )


def with_trouble(double: StreamingGatewayDouble) -> None:
    """Makes it a robot with a low battery, stale odometry, two active faults and a cleared one."""
    status = double.status
    status.platform.power.lipo_battery.percentage = 12
    status.health.state, status.health.summary = states.ROBOT_HEALTH_DEGRADED, "odometry stopped coming"
    status.health.odom_stale, status.health.odom_age_ms = True, 4000
    for name, severity, message, remedy in (
        ("odometry.stale", 3, "odometry stopped coming on /odom", "Check that the drive's node still runs"),
        ("battery.low", 2, "the robot's battery is low: 20 % or less", "Bring the robot to its charger"),
    ):
        component = name.split(".")[0]
        status.faults.add(
            id=name,
            severity=severity,
            component=component,
            message=message,
            remedy=remedy,
            active=True,
            age_ms=4000,
            times_raised=1,
        )
    status.faults.add(
        id="disk.full",
        severity=2,
        component="disk",
        message="the disk is nearly full: 95 % or more",
        active=False,
        cleared_age_ms=65_000,
        times_raised=1,
    )
