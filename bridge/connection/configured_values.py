"""The values that a robot's configuration names, in its state for the fleet: bounded, without noise. Pure.

| what happens | what the state has |
|---|---|
| more numbers or texts than fit | the worst ones, in their order, and how many are left out |
| a number, a position or an angle changes | no change: it comes with the next state, within 10 s |
| a level, a text, or whether a value is known or stale changes | a change, sent within a second |
| a text, title or unit of any length | its beginning |
| the robot has no such source | nothing |
"""

import math
from collections.abc import Callable, Iterable
from typing import Final, TypeVar

from google.protobuf.message import Message

from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from omniseer.gateway.v1.value_pb2 import (
    NUMBER_LEVEL_ERROR_HIGH,
    NUMBER_LEVEL_ERROR_LOW,
    NUMBER_LEVEL_WARNING_HIGH,
    NUMBER_LEVEL_WARNING_LOW,
    TEXT_LEVEL_ERROR,
    TEXT_LEVEL_WARNING,
    NumberStatus,
    TextStatus,
)

MOST_NUMBERS: Final = 16
MOST_TEXTS: Final = 16
_LABEL_CHARACTERS: Final = 64
_TITLE_CHARACTERS: Final = 64
_UNIT_CHARACTERS: Final = 16
_TEXT_CHARACTERS: Final = 100
_COORDINATE_DIGITS: Final = 6
"""Of a degree of latitude: 0.1 m."""
_ANGLE_DIGITS: Final = 1
_NUMBER_RANKS: Final = {
    NUMBER_LEVEL_ERROR_LOW: 2,
    NUMBER_LEVEL_ERROR_HIGH: 2,
    NUMBER_LEVEL_WARNING_LOW: 1,
    NUMBER_LEVEL_WARNING_HIGH: 1,
}
_TEXT_RANKS: Final = {TEXT_LEVEL_ERROR: 2, TEXT_LEVEL_WARNING: 1}
_COORDINATES: Final = ("latitude_deg", "longitude_deg")
_ANGLES: Final = ("roll_deg", "pitch_deg", "yaw_deg")
_MEASURED_POSITION: Final = (*_COORDINATES, "altitude_m", "horizontal_accuracy_m", "vertical_accuracy_m")

ValueT = TypeVar("ValueT", NumberStatus, TextStatus)


def add_values(state: RobotState, status: SystemStatus) -> None:
    """Writes the values of a status into a state."""
    numbers = _worst(status.numbers, MOST_NUMBERS, lambda each: _NUMBER_RANKS.get(each.level, 0))
    texts = _worst(status.texts, MOST_TEXTS, lambda each: _TEXT_RANKS.get(each.level, 0))
    state.numbers.extend(_number(each) for each in numbers)
    state.texts.extend(_text(each) for each in texts)
    state.values_left_out = len(status.numbers) + len(status.texts) - len(numbers) - len(texts)
    if status.position.available:
        state.position.CopyFrom(status.position)
        _round(state.position, _COORDINATES, _COORDINATE_DIGITS)
    if status.orientation.available:
        state.orientation.CopyFrom(status.orientation)
        _round(state.orientation, _ANGLES, _ANGLE_DIGITS)


def without_measurements(state: RobotState) -> None:
    """Takes out of a state, in place, what changes without anything having happened."""
    for number in state.numbers:
        number.age_ms = 0
        _forget(number, ("value",))
    for text in state.texts:
        text.age_ms = 0
    if state.HasField("position"):
        state.position.age_ms = 0
        _forget(state.position, _MEASURED_POSITION)
    if state.HasField("orientation"):
        state.orientation.age_ms = 0
        _forget(state.orientation, _ANGLES)


def _worst(values: Iterable[ValueT], most: int, rank: Callable[[ValueT], int]) -> list[ValueT]:
    """Returns so many values at most, the worst and of these the first ones, in their own order."""
    listed = list(values)
    kept = sorted(range(len(listed)), key=lambda index: (-rank(listed[index]), index))[:most]
    return [listed[index] for index in sorted(kept)]


def _number(value: NumberStatus) -> NumberStatus:
    made = NumberStatus(
        label=value.label[:_LABEL_CHARACTERS],
        title=value.title[:_TITLE_CHARACTERS],
        available=value.available,
        stale=value.stale,
        age_ms=value.age_ms,
        unit=value.unit[:_UNIT_CHARACTERS],
        level=value.level,
        tile=value.tile,
    )
    if value.HasField("value"):
        made.value = value.value
    if value.HasField("decimals"):
        made.decimals = value.decimals
    return made


def _text(value: TextStatus) -> TextStatus:
    made = TextStatus()
    made.CopyFrom(value)
    made.label = value.label[:_LABEL_CHARACTERS]
    made.title = value.title[:_TITLE_CHARACTERS]
    if value.HasField("text"):
        made.text = value.text[:_TEXT_CHARACTERS]
    return made


def _round(pose: Message, names: tuple[str, ...], digits: int) -> None:
    """Rounds in place; what is no finite number is left out."""
    for name in names:
        if pose.HasField(name):
            value = getattr(pose, name)
            if math.isfinite(value):
                setattr(pose, name, round(value, digits))
            else:
                pose.ClearField(name)


def _forget(message: Message, names: tuple[str, ...]) -> None:
    """Sets what is measured to 0 and leaves whether it is known: that is a change."""
    for name in names:
        if message.HasField(name):
            setattr(message, name, 0)
