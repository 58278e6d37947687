"""The table of sources: board, snapshot, change detection and configuration take every entry as it is.

Generic kinds (`number`, `text`) have one entry: the configuration makes a source of each label. A new kind
also needs a value type, a reader, a field of the schema and its mapping: docs/adding-a-source.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final, Generic, TypeVar

from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.values import (
    MAX_COMPONENTS,
    Battery,
    CommandSource,
    Compute,
    Detections,
    Diagnostics,
    Mode,
    Network,
    Number,
    Orientation,
    Position,
    Text,
    Velocity,
    Vision,
)

ValueT = TypeVar("ValueT")

_DAY_MS: Final = 86_400_000


@dataclass(frozen=True, eq=False)
class SourceSpec(Generic[ValueT]):
    """Describes one source. Compared by identity: a spec is the key of its values in dictionaries.

    Attributes:
        kind: `kind` of the configuration; "odometry" for example.
        value_type: what its readers return.
        label: distinguishes sources of the same kind; None where a kind has one source.
        title: name for people, where it does not follow from kind and label.
        meaning: what the configuration says of a generic value; None of other kinds.
        stale_after_ms: default age limit. Of a platform source the configuration's platform.stale_after_ms
            applies instead.
        queue_depth: depth of the subscription's KEEP_LAST history. With 1 the middleware drops older messages
            before Python sees them, so that a faster topic costs next to nothing.
        max_items: length to which lists are truncated before decoding; None: max_items of the configuration.
        merge: combines the present value with a new one; None: the new one replaces it.
        add_truncated: adds the number of list items that were truncated before decoding to a value.
        health_name: name in the health summary, where it differs from the one for people.
        quiet: published on change only, so silence is a fault only where the source is required.
        in_change_key: whether a new value counts as a change of the status.
    """

    kind: str
    value_type: type[ValueT]
    label: str | None = None
    title: str = ""
    meaning: NumberMeaning | TextMeaning | None = None
    stale_after_ms: int = 1000
    queue_depth: int = 1
    max_items: int | None = None
    merge: Callable[[ValueT, ValueT], ValueT] | None = None
    add_truncated: Callable[[ValueT, int], ValueT] | None = None
    health_name: str = ""
    quiet: bool = False
    in_change_key: bool = True

    # Cached: every status reads the names of all sources.
    @cached_property
    def name(self) -> str:
        """Unique, stable name for programs: "odometry", "mux_input.keyboard"."""
        return f"{self.kind}.{self.label}" if self.label else self.kind

    @cached_property
    def display_name(self) -> str:
        """The name for people: "odometry", "commands of keyboard"."""
        return self.title or (self.label or self.kind).replace("_", " ")


ODOMETRY: Final = SourceSpec("odometry", Velocity, health_name="odometry")
VISION: Final = SourceSpec("vision", Vision, stale_after_ms=2000, health_name="vision telemetry")
DETECTIONS: Final = SourceSpec(
    "detections",
    Detections,
    stale_after_ms=500,
    add_truncated=Detections.with_truncated,
    # Sent only to watchers that request them: status_stream.py compares them for those.
    in_change_key=False,
)
BATTERY: Final = SourceSpec("battery", Battery, stale_after_ms=5000, merge=Battery.merged)
"""The traction battery."""
DIAGNOSTICS: Final = SourceSpec(
    "diagnostics",
    Diagnostics,
    stale_after_ms=5000,
    # Many programs publish on this one topic, each about its own components.
    queue_depth=64,
    max_items=MAX_COMPONENTS,
    merge=Diagnostics.merged,
    # Those that matter are faults, and faults are part of the change key.
    in_change_key=False,
)
MODE: Final = SourceSpec("mode", Mode, stale_after_ms=_DAY_MS, quiet=True)
POSITION: Final = SourceSpec("position", Position, stale_after_ms=3000)
ORIENTATION: Final = SourceSpec("orientation", Orientation)
EFFECTIVE_COMMAND: Final = SourceSpec("effective_command", Velocity, stale_after_ms=500, quiet=True)
"""Output of the robot's command mux."""
MUX_INPUTS: Final = {
    label: SourceSpec(
        "mux_input",
        Velocity,
        label,
        title=f"commands of {label}",
        stale_after_ms=500,
        quiet=True,
        # Not in the status: they only attribute the effective command, which is.
        in_change_key=False,
    )
    for label in CommandSource
}
"""The inputs of the robot's command mux."""
COMPUTE: Final = SourceSpec("compute", Compute)
NETWORK: Final = SourceSpec("network", Network)
ONBOARD_BATTERY: Final = SourceSpec("onboard_battery", Battery)
"""The computer's own battery, as its operating system reports it."""

ROS_SOURCES: Final[tuple[SourceSpec[Any], ...]] = (
    ODOMETRY,
    VISION,
    DETECTIONS,
    BATTERY,
    DIAGNOSTICS,
    MODE,
    POSITION,
    ORIENTATION,
    EFFECTIVE_COMMAND,
    *MUX_INPUTS.values(),
)
"""Those that the ROS sampler writes onto the board, from the topics of the configuration."""
PLATFORM_SOURCES: Final[tuple[SourceSpec[Any], ...]] = (COMPUTE, NETWORK, ONBOARD_BATTERY)
"""Those that the platform sampler writes, from the operating system."""
NUMBER: Final = SourceSpec("number", Number, stale_after_ms=5000)
"""Stands for the kind; the sources of this kind are those of the configuration, see `number_source`."""
TEXT: Final = SourceSpec("text", Text, stale_after_ms=5000)
"""The same of texts, see `text_source`."""
GENERIC_KINDS: Final[tuple[SourceSpec[Any], ...]] = (NUMBER, TEXT)
"""Kinds of which the configuration makes sources, each with a label: a field of any message type."""
SOURCES: Final = (*ROS_SOURCES, *PLATFORM_SOURCES)
"""Every source. The health summary names the first one in this order that is missing."""


# Unbounded, because a spec that is made twice would be two keys; only the configuration makes new ones.
@cache
def number_source(label: str, title: str, meaning: NumberMeaning) -> SourceSpec[Number]:
    """Returns the source of a number; the same one whenever the arguments are equal."""
    return SourceSpec("number", Number, label, title, meaning, stale_after_ms=NUMBER.stale_after_ms)


@cache
def text_source(label: str, title: str, meaning: TextMeaning) -> SourceSpec[Text]:
    """Returns the source of a text; the same one whenever the arguments are equal."""
    return SourceSpec("text", Text, label, title, meaning, stale_after_ms=TEXT.stale_after_ms)
