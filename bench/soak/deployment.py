"""A whole robot in one ROS domain, with all of its programs, and its fleet's hub."""

import asyncio
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.product import serving
from bench.ros_domain import ros_domain
from bench.soak.readings import Reading
from common.ros_transport import VARIABLE
from console.client import CloudState, GatewayClient, Unreachable
from console.client.results import RecorderState
from console.receiver.address import StreamAddress
from simrobot.control import ask
from tests.support.driven_robot import TELEOP, driven_base
from tests.support.free import free_tcp_port, free_udp_port
from tests.support.heard import Base
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.ros_camera import ros_camera
from tests.support.running_bridge import BridgeProgram, bridge_program, prepare
from tests.support.running_drive import RunningDrive
from tests.support.running_recorder import recorder_program
from tests.support.running_tap import RunningTap
from tests.support.waiting import wait_until

LATENCY_MS: Final = 20
STEADY, PASSING, ARM = "steady", "passing", "arm"
"""Cameras: one that stays, one that ends every few seconds, as if it were unplugged, and one that is a ROS
topic."""
_ARM_TOPIC: Final = "/arm/image_raw"
_PASSING_FRAMES: Final = 90
_UP_WITHIN_S: Final = 60.0


class ArmCamera:
    """The camera that is a ROS topic: a publisher of its own after each start."""

    def __init__(self) -> None:
        self._publishing = ExitStack()

    def start(self) -> None:
        """Begins to publish, in the domain of the environment."""
        self._publishing.enter_context(ros_camera(_ARM_TOPIC))

    def stop(self) -> None:
        """Ends the publisher, if there is one."""
        self._publishing.close()


@dataclass(frozen=True, slots=True)
class Deployment:
    """All of it, running.

    Attributes:
        directory: for files of the rounds.
        target: the gateway's address.
        base: what the drive program moves.
        hub: of the fleet; one server.
        bridge: of the robot to it.
        arm: camera ARM.
        stream: where the preview's viewers connect while it is on.
    """

    directory: Path
    target: str
    base: Base
    hub: NatsServers
    bridge: BridgeProgram
    arm: ArmCamera
    stream: StreamAddress
    _processes: Mapping[str, int]
    _drive: RunningDrive
    _control: Path
    _logs: Mapping[str, Path]

    def change_sensors(self, **fields: Any) -> None:
        """Changes the behaviour of the simulated robot."""
        ask(self._control, fields)

    def readings(self) -> dict[str, Reading]:
        """Returns what each program has now, by its name.

        Raises:
            AssertionError: the drive program has no worker.
            OSError, psutil.Error: a program has ended.
        """
        processes = {
            **self._processes,
            "robot-drive's worker": self._drive.worker.pid,
            "robot-bridge": self.bridge.pid,
        }
        return {name: Reading.of(pid, self._logs.get(name)) for name, pid in processes.items()}


@contextmanager
def deployment() -> Iterator[Deployment]:
    """Runs all programs until the block ends; each serves when it begins."""
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(ros_domain(**{VARIABLE: "udp"}))  # as the containers have it
        base, drive = stack.enter_context(driven_base(directory))
        arm = ArmCamera()
        stack.callback(arm.stop)
        arm.start()
        (directory / "camera-tap").mkdir()
        tap = stack.enter_context(RunningTap(directory / "camera-tap"))
        encoded, udp, tcp = str(directory / "video-tap.sock"), free_udp_port(), free_tcp_port()
        preview = stack.enter_context(
            serving("robot-preview", directory, _preview_settings(directory, udp, encoded, str(tap.socket)))
        )
        recorder = stack.enter_context(recorder_program(directory, video={"socket": encoded}))
        hub = stack.enter_context(nats_servers(directory / "hub"))
        asyncio.run(prepare(hub.urls))
        bridge = stack.enter_context(bridge_program(directory, tcp, hub.urls))
        settings = {
            "grpc": {"port": tcp},
            "preview": {"socket": str(directory / "preview.sock"), "encrypted": False},
            "teleop": {"socket": str(drive.socket), **TELEOP},
            "recording": {"socket": str(recorder.socket)},
            "bridge": {"socket": str(bridge.socket)},
        }
        gateway = stack.enter_context(serving("robot-gateway", directory, settings))
        bridge.start()
        assert recorder.process
        programs = {
            "robot-gateway": gateway,
            "robot-preview": preview,
            "robot-drive": drive.process,
            "robot-tap": tap.process,
            "robot-recorder": recorder.process,
        }
        logs = {
            "robot-gateway": directory / "robot-gateway.log",
            "robot-preview": directory / "robot-preview.log",
            "robot-drive": drive.log,
            "robot-tap": tap.log,
            "robot-recorder": recorder.log,
            "robot-bridge": bridge.log,
        }
        made = Deployment(
            directory,
            f"127.0.0.1:{tcp}",
            base,
            hub,
            bridge,
            arm,
            StreamAddress("127.0.0.1", udp, LATENCY_MS),
            {name: process.pid for name, process in programs.items()},
            drive,
            directory / "robot.sock",
            logs,
        )
        _wait_until_whole(made)
        yield made


def _preview_settings(directory: Path, port: int, video_tap: str, camera_tap: str) -> dict[str, Any]:
    # One frame after the other, then the end of the stream.
    passing = f"videotestsrc is-live=true num-buffers={_PASSING_FRAMES} ! video/x-raw,width=640,height=360"
    return {
        "socket": str(directory / "preview.sock"),
        "cameras": {
            STEADY: {"kind": "test"},
            PASSING: {"kind": "gst", "description": passing, "fallback": STEADY},
            ARM: {"kind": "ros", "topic": _ARM_TOPIC, "fallback": STEADY},
        },
        "srt": {"bind": "127.0.0.1", "port": port, "latency_ms": LATENCY_MS},
        "encoders": {"order": ["x264"]},
        "video_tap": {"socket": video_tap},
        "camera_tap": {"socket": camera_tap},
        "runtime_dir": str(directory / "preview-run"),
    }


def _wait_until_whole(made: Deployment) -> None:
    with GatewayClient(made.target) as client:

        def is_whole() -> bool:
            try:
                status = client.status()
            except Unreachable:
                return False  # It does not listen yet.
            return bool(
                status.preview.service_reachable
                and status.odometry.available
                and status.teleop.enabled
                and status.recording
                and status.recording.state is RecorderState.IDLE
                and status.cloud
                and status.cloud.state is CloudState.CONNECTED
            )

        wait_until(is_whole, "every program of the robot serves", _UP_WITHIN_S)
