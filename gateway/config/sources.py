"""`sources`: the ROS 2 topics that the gateway reads."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from common.config import Section
from gateway.config.faults import LowerLimit, UpperLimit
from gateway.config.generic_sources import (
    LONGEST_TEXT,
    MOST_WORDS,
    FieldPath,
    Level,
    Remedy,
    Title,
    Unit,
    Word,
    check_generic_label,
    check_keys,
    check_order,
    check_words,
    text_meaning,
)
from gateway.status.meaning import NumberMeaning
from gateway.status.sources import GENERIC_KINDS, ROS_SOURCES, SourceSpec, number_source, text_source
from gateway.status.values import CommandSource

KINDS: Final = tuple(dict.fromkeys(spec.kind for spec in (*ROS_SOURCES, *GENERIC_KINDS)))
"""The values of `kind`, in the order of the table of sources."""
_SPECS: Final = {(spec.kind, spec.label): spec for spec in ROS_SOURCES}
_GENERIC: Final = frozenset(spec.kind for spec in GENERIC_KINDS)
_STALE_AFTER_MS: Final = {spec.kind: spec.stale_after_ms for spec in (*ROS_SOURCES, *GENERIC_KINDS)}


_TOPIC: Final = re.compile(r"(~/|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
"""A topic name as rcl_validate_topic_name accepts it, without substitutions."""
_LONGEST_TOPIC: Final = 247
"""Of a full name: RMW_TOPIC_MAX_NAME_LENGTH."""
_PUT_IN_FRONT: Final[Mapping[str, int]] = {"/": 0, "~": len("/robot_gateway") - 1}
"""By the beginning of a name, the characters that its full name has more: in place of ~ is the node's name;
other relative names are those of the root namespace, and get a slash."""
_LARGEST_IMAGE_PX: Final = 65_535
"""Of a side: more than any camera has, and within the contract's uint32."""
_TYPE: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*/msg/[A-Za-z][A-Za-z0-9_]*")


def _known_kind(kind: str) -> str:
    if kind not in KINDS:
        raise ValueError(f"one of {', '.join(KINDS)}")
    return kind


def _topic_name(topic: str) -> str:
    if not _TOPIC.fullmatch(topic):
        raise ValueError("a topic name of letters, digits, _ and /, /odometry/filtered for example")
    most = _LONGEST_TOPIC - _PUT_IN_FRONT.get(topic[0], 1)
    if len(topic) > most:
        raise ValueError(f"a topic name of at most {most} characters")
    return topic


def _type_name(name: str) -> str:
    if not _TYPE.fullmatch(name):
        raise ValueError("a message type, nav_msgs/msg/Odometry for example")
    return name


class SourceSettings(Section):
    """One ROS 2 topic."""

    # The schema repeats what the validators check: editors complete by it, and the validators' sentences are
    # for people.
    kind: Annotated[str, AfterValidator(_known_kind), Field(json_schema_extra={"enum": [*KINDS]})]
    """What its values are."""
    label: str | None = None
    """Distinguishes sources of one kind: the input of the command mux, or the name of a generic value."""
    title: Title = ""
    """Name of a generic value for operators; by default its label with blanks."""
    topic: Annotated[
        str,
        AfterValidator(_topic_name),
        Field(json_schema_extra={"pattern": f"^{_TOPIC.pattern}$", "maxLength": _LONGEST_TOPIC}),
    ]
    """Name of the topic, /odometry/filtered for example."""
    type: Annotated[
        str, AfterValidator(_type_name), Field(json_schema_extra={"pattern": f"^{_TYPE.pattern}$"})
    ]
    """Type of its messages, nav_msgs/msg/Odometry for example."""
    field: FieldPath | None = None
    """The field of the message that a generic value is."""
    tile: bool = False
    """Whether operators' windows show a generic value over the picture, too."""
    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    stale_after_ms: int = Field(default_factory=lambda validated: _STALE_AFTER_MS[validated["kind"]], gt=0)
    """Age from which the value is too old to rely on; the default depends on the kind."""
    required: bool = False
    """Whether the robot is degraded and not ready without this source."""
    image_width_px: int = Field(default=1280, gt=0, le=_LARGEST_IMAGE_PX)
    """Width of the image that the boxes of detections refer to; the messages don't hold it."""
    image_height_px: int = Field(default=720, gt=0, le=_LARGEST_IMAGE_PX)
    """Height of that image."""
    max_items: int = Field(default=100, ge=1, le=1000)
    """Number of detections of one image that are kept; all are counted."""

    unit: Unit = ""
    """Of a number, as operators see it; limits are in this unit."""
    scale: float = Field(default=1.0, allow_inf_nan=False)
    """Factor from the message's unit to `unit`."""
    offset: float = Field(default=0.0, allow_inf_nan=False)
    """Added after scaling: -273.15 from kelvin to °C."""
    decimals: int | None = Field(default=None, ge=0, le=9)
    """Digits behind the point: smaller differences are neither shown nor a change of the status."""
    warning_below: LowerLimit | None = None
    error_below: LowerLimit | None = None
    warning_above: UpperLimit | None = None
    error_above: UpperLimit | None = None
    remedy: Remedy = ""
    """What operators should do beyond a limit."""

    max_length: int = Field(default=80, ge=1, le=LONGEST_TEXT)
    """Characters of a text that are kept."""
    names: Mapping[int, Word] = Field(default={}, max_length=MOST_WORDS)
    """Texts of the numbers of an integer field, as the constants of its message type have them."""
    levels: Mapping[Word, Level] = Field(default={}, max_length=MOST_WORDS)
    """How bad texts are, each exactly as it is shown."""
    other_level: Level = "good"
    """How bad every other text is."""

    @property
    def spec(self) -> SourceSpec[Any]:
        """The entry of the table of sources; of a generic kind the one that belongs to this label."""
        if self.kind == "number":
            return number_source(self.label or "", self.title, self._meaning())
        if self.kind == "text":
            meaning = text_meaning(self.levels, self.other_level, self.remedy, tile=self.tile)
            return text_source(self.label or "", self.title, meaning)
        return _SPECS[self.kind, self.label]

    @property
    def name(self) -> str:
        """Unique, stable name for programs: "odometry", "mux_input.keyboard", "number.motor_temperature"."""
        return self.spec.name

    @property
    def is_generic(self) -> bool:
        """Whether it is a field of any message type, instead of a type with a reader of its own."""
        return self.kind in _GENERIC

    @model_validator(mode="after")
    def _check_label(self) -> Self:
        if self.kind in _GENERIC:
            check_generic_label(self.kind, self.label)
        elif (self.kind, self.label) not in _SPECS:
            labels = ", ".join(source.value for source in CommandSource)
            kinds = ", ".join(sorted(_GENERIC))
            raise ValueError(f"only sources of kind mux_input ({labels}) and {kinds} (any) have a label")
        return self

    @model_validator(mode="after")
    def _check_generic(self) -> Self:
        defaults = {name: field.default for name, field in type(self).model_fields.items()}
        changed = {name: value for name, value in self if value != defaults[name]}
        check_keys(self.kind, changed)
        check_order((self.error_below, self.warning_below), (self.error_above, self.warning_above))
        check_words((*self.levels, *self.names.values()), self.max_length)
        if not self.scale:
            raise ValueError("scale must not be 0: every value would be the same")
        return self

    def _meaning(self) -> NumberMeaning:
        return NumberMeaning(
            unit=self.unit,
            decimals=self.decimals,
            warning_below=self.warning_below.limit() if self.warning_below else None,
            error_below=self.error_below.limit() if self.error_below else None,
            warning_above=self.warning_above.limit() if self.warning_above else None,
            error_above=self.error_above.limit() if self.error_above else None,
            remedy=self.remedy,
            tile=self.tile,
        )


_TWIST: Final = "geometry_msgs/msg/TwistStamped"

DEFAULT_SOURCES: Final = (
    SourceSettings(kind="odometry", topic="/odometry/filtered", type="nav_msgs/msg/Odometry", required=True),
    SourceSettings(
        kind="vision", topic="/vision/perf", type="omniseer_msgs/msg/VisionPerfSummary", required=True
    ),
    SourceSettings(kind="detections", topic="/yolo/detections", type="yolo_msgs/msg/DetectionArray"),
    SourceSettings(kind="battery", topic="/battery", type="sensor_msgs/msg/BatteryState"),
    SourceSettings(kind="diagnostics", topic="/diagnostics", type="diagnostic_msgs/msg/DiagnosticArray"),
    SourceSettings(kind="mux_input", label=CommandSource.KEYBOARD, topic="/cmd_vel_keyboard", type=_TWIST),
    SourceSettings(kind="mux_input", label=CommandSource.AUTONOMY, topic="/cmd_vel_autonomy", type=_TWIST),
    SourceSettings(kind="mux_input", label=CommandSource.NAVIGATION, topic="/cmd_vel_nav", type=_TWIST),
    SourceSettings(kind="effective_command", topic="/mecanum_drive_controller/reference", type=_TWIST),
)
"""The topics of the first robot. It publishes no mode; a robot that does has one more source."""
