"""Behaviour and faults of the simulated robot: an immutable value that control requests replace."""

from enum import Enum
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.config_problems import first_problem
from common.errors import ExitCode, UserError


class Topic(Enum):
    """A topic that the robot publishes."""

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
"""The inputs of the command mux, and its output."""


class Commander(Enum):
    """The source of the velocity commands that the mux selects."""

    KEYBOARD = "keyboard"
    AUTONOMY = "autonomy"
    NAVIGATION = "navigation"
    UNSEEN = "unseen"
    """The mux emits commands that are on none of its inputs, of a joystick wired to it for example."""
    NOBODY = "nobody"
    """No input has commands, and the mux emits none."""


class Component(Enum):
    """A component that appears in the diagnostics."""

    DRIVE = "drive"
    BATTERY = "battery"
    VISION = "vision"
    LIDAR = "lidar"


class Level(Enum):
    """The diagnostic level of a component."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"
    STALE = "stale"


class Behaviour(BaseModel):
    """Behaviour of the robot. The defaults are a healthy robot driving in a circle."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    silent: frozenset[Topic] = frozenset()
    """Topics without messages; their publishers stay in the graph."""
    not_a_number: frozenset[Topic] = frozenset()
    """Topics whose measured values are NaN."""
    speed_mps: float = 0.5
    """Forward speed."""
    turn_rad_s: float = 0.25
    """Yaw rate, positive to the left (REP 103)."""
    infer_errors_per_s: float = Field(default=0.0, ge=0)
    """Failed inferences per second, as counted by the vision process."""
    detection_count: int = Field(default=3, ge=0, le=100_000)
    """Objects in each frame."""
    battery_percent: float = Field(default=87.0, ge=0, le=100)
    """Charge at the moment of the change; it drains from there."""
    battery_drain_percent_per_s: float = 0.01
    """Rate at which the charge falls; negative while charging."""
    commander: Commander = Commander.AUTONOMY
    """The input that the mux selects."""
    mode: str = Field(default="exploring", max_length=1000)
    """Mission mode; published on change."""
    components: dict[Component, Level] = Field(default_factory=dict)
    """Levels that override the actual state of components."""

    def changed(self, fields: dict[str, Any]) -> "Behaviour":
        """Returns this behaviour with `fields` replaced, given as JSON values.

        Raises:
            UserError: a field is unknown or a value is not allowed.
        """
        try:
            return Behaviour.model_validate(self.model_dump(mode="json") | fields)
        except ValidationError as error:
            problem = first_problem(error, Behaviour, noun="field").text
            raise UserError(f"behaviour: {problem}", exit_code=ExitCode.USAGE) from error
