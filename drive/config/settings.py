"""Settings of the drive program: one YAML file, overridden by `DRIVE__...` environment variables."""

import os
import tempfile
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings, SettingsConflictError
from common.socket_path import SocketPath
from common.text_form import Form
from drive.motion.inhibits import Deadlines
from drive.motion.machine import OnLoss, Rules
from drive.motion.shaping import Limits
from drive.motion.values import MS

_DEFAULT: Final = Limits()
VelocityType = Literal["geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"]
Topic = Annotated[
    str,
    Field(max_length=247),
    Form(
        "/[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*",
        "a topic name of letters, digits, _ and / that begins with /, /odometry/filtered for example",
    ),
]
"""Full name of a topic; of 247 characters at the most (RMW_TOPIC_MAX_NAME_LENGTH)."""


class Output(Section):
    """A topic that velocities are published on."""

    topic: Topic = "/cmd_vel_keyboard"
    type: VelocityType = "geometry_msgs/msg/TwistStamped"
    frame_id: str = Field(default="base_link", max_length=64)
    """`header.frame_id` of a TwistStamped."""


class MuxOutput(Section):
    """The topic on which the velocities reach the base, whichever source they come from."""

    topic: Topic = "/mecanum_drive_controller/reference"
    type: VelocityType = "geometry_msgs/msg/TwistStamped"


class LimitSettings(Section):
    """What the robot may do. Faster commands are slowed down, all components by one factor."""

    vx_mps: float = Field(default=_DEFAULT.vx_mps, gt=0, le=10)
    vy_mps: float = Field(default=_DEFAULT.vy_mps, ge=0, le=10)
    """0 for a base that can't move sideways."""
    wz_rad_s: float = Field(default=_DEFAULT.wz_rad_s, gt=0, le=20)
    wheel_mps: float = Field(default=_DEFAULT.wheel_mps, ge=0, le=10)
    """Largest speed of a mecanum wheel's rim, |vx| + |vy| + wheel_lever_m * |wz|. 0 for any other base."""
    wheel_lever_m: float = Field(default=_DEFAULT.wheel_lever_m, ge=0, le=10)
    acceleration_mps2: float = Field(default=_DEFAULT.acceleration_mps2, gt=0, le=50)
    acceleration_rad_s2: float = Field(default=_DEFAULT.acceleration_rad_s2, gt=0, le=100)
    picture_travel_m: float = Field(default=_DEFAULT.picture_travel_m, gt=0, le=1)
    """Farthest motion within one age of the driver's picture."""
    picture_turn_rad: float = Field(default=_DEFAULT.picture_turn_rad, gt=0, le=2)
    line_of_sight_mps: float = Field(default=_DEFAULT.line_of_sight_mps, gt=0, le=10)
    """Largest speed without a picture; also of older tools."""
    line_of_sight_rad_s: float = Field(default=_DEFAULT.line_of_sight_rad_s, gt=0, le=20)
    release_ramp_s: float = Field(default=0.0, ge=0, le=0.5)
    """Slowing down after a voluntary release. Everything else stops at once."""


class DeadlineSettings(Section):
    """How old what decides about motion may be, in ms. They may be shortened, not prolonged."""

    command_ms: int = Field(default=250, ge=60, le=250)
    unary_ms: int = Field(default=500, ge=60, le=500)
    loop_ms: int = Field(default=400, ge=100, le=400)
    picture_ms: int = Field(default=600, ge=100, le=600)


def _default_state_dir() -> Path:
    if own := os.environ.get("XDG_STATE_HOME"):
        return Path(own) / "robot-drive"
    return Path(tempfile.gettempdir()) / f"robot-drive-{os.getuid()}"


class DriveSettings(Settings):
    """All settings of the drive program. The defaults suit the first robot."""

    model_config = SettingsConfigDict(env_prefix="DRIVE__")

    socket: SocketPath = Path("/run/robot-gateway/drive.sock")
    """Unix socket on which the gateway connects."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """Text for people, or one JSON object per line for programs."""
    outputs: tuple[Output, ...] = Field(default=(Output(),), min_length=1, max_length=8)
    """Inputs of the robot's multiplexer, the one of highest priority first."""
    lock_topic: Topic | None = "/cmd_vel_emergency_stop"
    """A std_msgs/Bool that locks the multiplexer, for stops. None: zeros alone."""
    stop_topics: tuple[Topic, ...] = Field(default=(), max_length=8)
    """std_msgs/Bool of the robot's own stop buttons: true forbids motion."""
    stop_timeout_ms: int | None = Field(default=None, ge=50, le=60_000)
    """Silence on a stop topic that counts as pressed. None: its publisher need not repeat itself."""
    mux_output: MuxOutput | None = MuxOutput()
    """Compared with what is commanded here. None: not known."""
    base_timeout_ms: int | None = Field(default=None, ge=20, le=60_000)
    """Silence after which the base stops by itself, for the doctor: what stops the robot if this computer
    freezes. None: not known."""
    odometry: Topic | None = "/odometry/filtered"
    """A nav_msgs/Odometry that shows when the robot stands still. None: assumed a second after a release."""
    limits: LimitSettings = LimitSettings()
    deadlines: DeadlineSettings = DeadlineSettings()
    on_loss: OnLoss = OnLoss.HOLD
    """What becomes of the robot when its driver or the gateway is lost while driving: it stays stopped until
    a person resets the stop (hold), or other sources of commands have it again (hand_back)."""
    state_dir: Path = Field(default_factory=_default_state_dir)
    """Keeps a stop over a restart; made this user's own."""

    def check(self) -> None:
        """Raises a `SettingsConflictError` where values are valid each, but not together."""
        if self.lock_topic in self.stop_topics:
            raise SettingsConflictError(
                ("stop_topics", self.stop_topics.index(self.lock_topic)),
                f"stop_topics lists {self.lock_topic}, which is lock_topic: robot-drive publishes there "
                "itself, and could not distinguish the robot's own stop from its lock",
                "Give the stop button and the lock of robot-drive a topic each",
            )

    @property
    def stop_path(self) -> Path:
        """The file that keeps a stop over a restart."""
        return self.state_dir / "stop.json"

    @property
    def rules(self) -> Rules:
        """The settings as the machine takes them."""
        limits = self.limits.model_dump(exclude={"release_ramp_s"})
        deadlines = self.deadlines
        return Rules(
            limits=Limits(**limits),
            deadlines=Deadlines(
                command_ns=deadlines.command_ms * MS,
                unary_ns=deadlines.unary_ms * MS,
                loop_ns=deadlines.loop_ms * MS,
                picture_ns=deadlines.picture_ms * MS,
            ),
            on_loss=self.on_loss,
            release_ramp_s=self.limits.release_ramp_s,
        )
