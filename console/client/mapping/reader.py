"""Reads messages of the contract into results: a field of a result is the message's field of the same name.

The tables name the exceptions. What is not known is None, by the first of these that applies:

- The values of a `Sample` that is not available, and the optional values of a part that was not sent.
- A value whose flag in the message is down.
- A field that is unset, where the schema distinguishes that.
- A measured number that is NaN or infinite; an empty text outside a `Sample`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from types import UnionType
from typing import Any, Final, TypeVar, cast, get_args, get_origin, get_type_hints

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from common.printable import printable, printable_lines
from console.client import results
from console.client.mapping import enums

ResultT = TypeVar("ResultT")

_DIGITS: Final = 7
"""Significant decimal digits of an IEEE 754 binary32 (24 bits): 0.1 stays 0.1."""
_ITSELF: Final = ""
"""Instead of a field's name: the part is read from the same message."""

_RENAMED: Final[Mapping[type, Mapping[str, str]]] = {
    results.SystemStatus: {"odometry": "health"},
    results.Odometry: {
        "available": "odom_available",
        "stale": "odom_stale",
        "age_ms": "odom_age_ms",
        "vx_mps": "measured_vx_mps",
        "vy_mps": "measured_vy_mps",
        "wz_rad_s": "measured_wz_rad_s",
    },
    results.Teleop: {"last_command": _ITSELF},
    results.TeleopCommand: {
        "available": "last_command_available",
        "stale": "last_command_stale",
        "age_ms": "last_command_age_ms",
        "vx_mps": "last_command_vx_mps",
        "vy_mps": "last_command_vy_mps",
        "wz_rad_s": "last_command_wz_rad_s",
    },
    results.Battery: {"voltage_v": "voltage", "charge_percent": "percentage"},
    results.Detections: {"count": "detection_count", "items": "detections"},
    results.Detection: {
        "center_x_px": "bbox_center_x_px",
        "center_y_px": "bbox_center_y_px",
        "width_px": "bbox_width_px",
        "height_px": "bbox_height_px",
    },
    results.Event: {
        "position": _ITSELF,
        "preview": "preview_state_changed",
        "control": "control_action",
        "recording": "recording_state_changed",
        "cloud": "cloud_state_changed",
        "recording_copy": "recording_copy_changed",
    },
}
"""Field of a result -> field of the message."""

_FLAGS: Final[Mapping[type, Mapping[str, str]]] = {
    results.Compute: {
        "cpu_temperature_c": "cpu_temperature_available",
        "thermal_throttled": "thermal_throttled_available",
        "disk_used_percent": "disk_available",
    },
    results.Network: {
        "wifi_signal_dbm": "wifi_signal_available",
        "link_quality_percent": "link_quality_available",
    },
    results.Battery: {
        "voltage_v": "voltage_available",
        "charge_percent": "percentage_available",
        "charging": "charging_available",
    },
}
"""Field of a result -> the message's flag that says whether it is known."""

_Read = Callable[[Any, bool], Any]
"""Returns a field's value, from the message and whether its optional values are known."""


def read(result: type[ResultT], message: Message, **given: object) -> ResultT:
    """Returns a result.

    Args:
        result: Its class.
        message: The message that it is read from.
        given: Fields that come from elsewhere.
    """
    read_it: Callable[..., ResultT] = _reader(cast("Any", result), message.DESCRIPTOR)
    return read_it(message, **given)


def number(value: float) -> float:
    """Returns a 32-bit float rounded to its significant digits."""
    return float(f"{value:.{_DIGITS}g}")


@cache
def _reader(result: Any, message: Descriptor) -> Callable[..., Any]:
    """Returns a function that reads one kind of result from one kind of message."""
    kinds, names = get_type_hints(result), _RENAMED.get(result, {})
    available = names.get("available", "available") if issubclass(result, results.Sample) else None
    parts: list[tuple[str, _Read]] = []
    for field in fields(result):
        name, kind = names.get(field.name, field.name), kinds[field.name]
        if name == _ITSELF:
            parts.append((field.name, _reader(kind, message)))
        elif name in message.fields_by_name:
            parts.append((field.name, _part(result, field.name, kind, message.fields_by_name[name])))

    def read_it(message: Any, known: bool = True, **given: object) -> Any:
        if available:
            known = getattr(message, available)
        return result(**{name: part(message, known) for name, part in parts}, **given)

    return read_it


def _part(result: type, name: str, kind: Any, source: Any) -> _Read:
    """Returns a function that reads one field.

    Args:
        result: The class of the result.
        name: The field's name in it.
        kind: The field's type.
        source: Descriptor of the message's field.
    """
    there, has_presence, items = source.name, source.has_presence, get_origin(kind) is tuple
    optional = isinstance(kind, UnionType)
    if items or optional:
        kind = get_args(kind)[0]
    flag = _FLAGS.get(result, {}).get(name)
    measured, convert = kind is float, _converter(name, kind, source)
    empty_is_unknown = kind is str and not issubclass(result, results.Sample)

    def read_optional(message: Any, known: bool) -> Any:
        if not known or (flag and not getattr(message, flag)):
            return None
        if has_presence and not message.HasField(there):
            return None
        value = getattr(message, there)
        if (measured and not math.isfinite(value)) or (empty_is_unknown and not value):
            return None
        return convert(value)

    if optional:
        return read_optional
    if items:
        return lambda message, known: tuple(map(convert, getattr(message, there))) if known else ()
    if is_dataclass(kind):
        return lambda message, _: convert(getattr(message, there), message.HasField(there))
    return lambda message, _: convert(getattr(message, there))


def _converter(name: str, kind: Any, source: Any) -> Callable[..., Any]:
    """Returns the conversion of one value to a type of the results."""
    if source.message_type:
        return _reader(kind, source.message_type)
    if name == "configuration_json":
        return printable_lines
    if issubclass(kind, Enum):
        return partial(enums.member, kind, source.enum_type)
    if source.type == FieldDescriptor.TYPE_DOUBLE:
        return float
    conversions: dict[type, Callable[[Any], Any]] = {str: printable, float: number}
    return conversions.get(kind, lambda value: value)
