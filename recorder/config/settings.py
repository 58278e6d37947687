"""Settings of the recorder: one YAML file, overridden by `RECORDER__...` environment variables."""

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings
from common.socket_path import SocketPath
from common.text_form import Form

MIB: Final = 1024 * 1024
Pattern = Annotated[
    str,
    Field(max_length=255),
    Form("[/*][A-Za-z0-9_/*]*", "a topic's full name, or several with *, /odom or /camera/* for example"),
]
"""A topic's name, in which "*" stands for any number of characters, "/" included."""
_PRESET_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_MAX_TOPICS: Final = 256


class PresetSettings(Section):
    """What a recording contains."""

    description: str = Field(default="", max_length=200)
    """For people."""
    topics: tuple[Pattern, ...] = Field(min_length=1, max_length=_MAX_TOPICS)
    exclude: tuple[Pattern, ...] = Field(default=(), max_length=_MAX_TOPICS)
    """Of the topics above."""
    video: bool = False
    """Whether the preview's video is recorded, too, unless the caller says otherwise."""

    def selects(self, topic: str) -> bool:
        """Returns whether the topic is recorded."""
        return _matches(topic, self.topics) and not _matches(topic, self.exclude)


DEFAULT_PRESETS: Final[Mapping[str, PresetSettings]] = {
    "driving": PresetSettings(
        description="How the robot moved and why, without images and point clouds",
        topics=(
            "/tf",
            "/tf_static",
            "/robot_description",
            "/odometry/*",
            "/odom",
            "/cmd_vel*",
            "/mecanum_drive_controller/*",
            "/imu/*",
            "/battery",
            "/battery_state",
            "/diagnostics",
            "/joint_states",
            "/scan",
            "/plan",
            "/goal_pose",
            "/rosout",
        ),
        video=True,
    ),
    "everything": PresetSettings(
        description="All topics, and the video",
        topics=("*",),
        # Actions and parameters of nodes: traffic of the middleware, not of the robot.
        exclude=("*/_action/*", "/parameter_events"),
        video=True,
    ),
}


class RingSettings(Section):
    """The last minutes, recorded at all times."""

    preset: str | None = None
    """What it records. None: no ring, and so no snapshots and no incidents."""
    seconds: int = Field(default=120, ge=10, le=3600)
    """At least so much is kept, unless room is short."""
    directory: Path | None = None
    """Default: `ring` below `root`. In another file system, a tmpfs for example, snapshots are copies."""


class SnapshotSettings(Section):
    """Snapshots that a caller requests without lengths."""

    pre_s: int = Field(default=30, ge=0, le=3600)
    post_s: int = Field(default=10, ge=0, le=600)


class IncidentSettings(Section):
    """Snapshots that the robot makes by itself when a fault is raised. They need a ring."""

    enabled: bool = True
    min_severity: Literal["info", "warning", "error"] = "error"
    pre_s: int = Field(default=30, ge=0, le=3600)
    post_s: int = Field(default=10, ge=0, le=600)
    cooldown_s: int = Field(default=60, ge=0, le=86_400)
    """After an incident, the same fault makes none for so long."""
    ignore: tuple[str, ...] = Field(default=(), max_length=64)
    """IDs of faults that never make one."""


class RoomSettings(Section):
    """How much of the disk recordings may take."""

    quota_bytes: int = Field(default=0, ge=0)
    """Of all recordings and the ring. 0: no quota."""
    min_free_bytes: int | None = Field(default=None, ge=0)
    """What stays free. None: the larger of 1 GiB and 5 % of the file system."""


class SegmentSettings(Section):
    """When a new file of a recording begins."""

    max_bytes: int = Field(default=64 * MIB, ge=MIB, le=1024 * MIB)
    max_s: int = Field(default=60, ge=1, le=3600)


class VideoSettings(Section):
    """Where the video comes from."""

    socket: SocketPath | None = None
    """The preview's video tap. None: recordings have no video."""


class ExportSettings(Section):
    """Copies to operators."""

    max_bytes_per_s: int = Field(default=0, ge=0)
    """Of all exports together. 0: no limit."""


class RecorderSettings(Settings):
    """All settings of the recorder."""

    model_config = SettingsConfigDict(env_prefix="RECORDER__")

    socket: SocketPath = Path("/run/robot-gateway/recorder.sock")
    """Unix socket on which the gateway connects."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """Text for people, or one JSON object per line for programs."""
    root: Path = Path("/var/lib/robot-recorder")
    """The folder of all recordings."""
    presets: Mapping[str, PresetSettings] = Field(default=DEFAULT_PRESETS, min_length=1, max_length=32)
    """What can be recorded, by name. The first one is recorded when a caller names none."""
    ring: RingSettings = RingSettings()
    snapshot: SnapshotSettings = SnapshotSettings()
    incidents: IncidentSettings = IncidentSettings()
    room: RoomSettings = RoomSettings()
    segments: SegmentSettings = SegmentSettings()
    queue_bytes: int = Field(default=64 * MIB, ge=MIB, le=4096 * MIB)
    """Between the topics and the disk: how long the disk may stand still before messages are dropped."""
    video: VideoSettings = VideoSettings()
    run_bundles: tuple[Path, ...] = Field(default=(), max_length=16)
    """Folders that hold folders of the robot's own experiments; listed and exported, never changed."""
    export: ExportSettings = ExportSettings()

    @model_validator(mode="after")
    def _presets_are_named_and_known(self) -> Self:
        for name in self.presets:
            if not _PRESET_NAME.fullmatch(name):
                raise ValueError(
                    f"'{name}' can't be a preset's name: letters, digits, '-' and '_', at most 64"
                )
        if self.ring.preset is not None and self.ring.preset not in self.presets:
            known = ", ".join(self.presets)
            raise ValueError(f"ring.preset '{self.ring.preset}' is not a preset; known are {known}")
        return self

    @property
    def first_preset(self) -> str:
        """The one that is recorded when a caller names none."""
        return next(iter(self.presets))

    def records_video(self, preset: str) -> bool:
        """Returns whether a recording of a preset has the video unless a caller says otherwise."""
        return self.presets[preset].video and self.video.socket is not None

    @property
    def folders(self) -> tuple[Path, ...]:
        """Where recordings and the ring are: what the quota counts."""
        apart = self.ring.directory if self.ring.preset else None
        return (self.root, apart) if apart else (self.root,)

    @property
    def ring_directory(self) -> Path:
        """Where the ring is."""
        return self.ring.directory or self.root / "ring"


def _matches(topic: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(topic, pattern) for pattern in patterns)
