"""What the simulated robot does, and what is wrong with it: a frozen value that control requests replace."""

from enum import Enum
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.errors import ExitCode, UserError


class Topic(Enum):
    """What the robot publishes."""

    ODOMETRY = "odometry"
    VISION = "vision"
    DETECTIONS = "detections"
    BATTERY = "battery"
    DIAGNOSTICS = "diagnostics"
    MODE = "mode"
    KEYBOARD_COMMANDS = "keyboard_commands"
    AUTONOMY_COMMANDS = "autonomy_commands"
    NAVIGATION_COMMANDS = "navigation_commands"
    EFFECTIVE_COMMAND = "effective_command"


COMMANDS = (
    Topic.KEYBOARD_COMMANDS,
    Topic.AUTONOMY_COMMANDS,
    Topic.NAVIGATION_COMMANDS,
    Topic.EFFECTIVE_COMMAND,
)
"""The inputs of the command mux, and what it lets through."""


class Commander(Enum):
    """Who drives."""

    KEYBOARD = "keyboard"
    AUTONOMY = "autonomy"
    NAVIGATION = "navigation"
    UNSEEN = "unseen"
    """The mux emits commands that none of its inputs gave: a joystick wired to it, for example."""
    NOBODY = "nobody"
    """No input speaks, and the mux emits nothing."""


class Component(Enum):
    """What reports in the diagnostics."""

    DRIVE = "drive"
    BATTERY = "battery"
    VISION = "vision"
    LIDAR = "lidar"


class Level(Enum):
    """What a component reports of itself."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"
    STALE = "stale"


class Behaviour(BaseModel):
    """How the robot behaves from now on. The defaults are a healthy robot driving in a circle."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    silent: frozenset[Topic] = frozenset()
    """Topics that publish nothing; their publishers stay in the graph."""
    not_a_number: frozenset[Topic] = frozenset()
    """Topics whose measured values are NaN."""
    speed_mps: float = 0.5
    """Forward speed."""
    turn_rad_s: float = 0.25
    """Rate of turn, to the left."""
    infer_errors_per_s: float = Field(default=0.0, ge=0)
    """Failed inferences that the vision process counts per second."""
    detection_count: int = Field(default=3, ge=0, le=100_000)
    """Objects in each picture."""
    battery_percent: float = Field(default=87.0, ge=0, le=100)
    """Charge at the moment this is set; it drains from there."""
    battery_drain_percent_per_s: float = 0.01
    """How fast the charge falls; negative while charging."""
    commander: Commander = Commander.AUTONOMY
    """Whose commands the mux lets through."""
    mode: str = Field(default="exploring", max_length=1000)
    """What the robot is about; told when it changes."""
    components: dict[Component, Level] = Field(default_factory=dict)
    """Levels that components report whatever their true state is."""

    def changed(self, wish: dict[str, Any]) -> "Behaviour":
        """This behaviour with some fields replaced, from JSON values.

        Raises:
            UserError: an unknown field or a value that is not allowed.
        """
        try:
            return Behaviour.model_validate(self.model_dump(mode="json") | wish)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            field = ".".join(str(part) for part in first["loc"])
            raise UserError(
                f"behaviour '{field}': {first['msg']}",
                f"Fields are {', '.join(Behaviour.model_fields)}; "
                f"topics are {', '.join(topic.value for topic in Topic)}",
                exit_code=ExitCode.USAGE,
            ) from error
