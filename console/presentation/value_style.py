"""How good the values of a part are: a fresh value may still be a bad one.

The limits are the defaults of the gateway's fault rules (docs/configuration.md, `faults`) where it has one;
beyond `bad` an operator should act at once. A robot's own limits may be others: a part is at least as bad as
its own active fault, so that no tick denies one.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from console.client import results
from console.client.results import Fault, FaultSeverity, NumberLevel, RecorderState, TextLevel
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle


class Judgement(NamedTuple):
    """A style, and the word for it; the word is empty for good values."""

    style: SeverityStyle
    word: str


GOOD: Final = Judgement(SeverityStyle.GOOD, "")
_ROOM_UNKNOWN: Final = (RecorderState.UNKNOWN, RecorderState.UNREACHABLE, RecorderState.RECOVERING)
_ORDER: Final = (SeverityStyle.QUIET, SeverityStyle.GOOD, SeverityStyle.WARNING, SeverityStyle.BAD)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one figure; where `bad` is below `warning`, low values are the bad ones.

    Args:
        warning: from here on a value is a warning.
        bad: from here on it is an error.
        word: says which way it is off.
    """

    warning: float
    bad: float
    word: str

    def judge(self, value: float | None) -> Judgement:
        """Returns the judgement of a value; an unknown one is not worse than any other."""
        if value is None:
            return GOOD
        sign = -1 if self.bad < self.warning else 1
        if sign * value >= sign * self.bad:
            return Judgement(SeverityStyle.BAD, self.word)
        if sign * value >= sign * self.warning:
            return Judgement(SeverityStyle.WARNING, self.word)
        return GOOD


CHARGE_PERCENT: Final = Limits(20, 10, "LOW")
TEMPERATURE_C: Final = Limits(85, 95, "HOT")
CPU_PERCENT: Final = Limits(95, 101, "BUSY")
MEMORY_PERCENT: Final = Limits(92, 97, "FULL")
DISK_PERCENT: Final = Limits(95, 98, "FULL")
WIFI_DBM: Final = Limits(-75, -85, "WEAK")
LOSS_PERCENT: Final = Limits(2, 10, "LOSSY")
ROUND_TRIP_MS: Final = Limits(150, 400, "SLOW")
PICTURE_AGE_MS: Final = Limits(150, 400, "LATE")
"""An older picture hurts driving."""
NUMBER_LEVELS: Final[Mapping[NumberLevel, Judgement]] = {
    NumberLevel.UNKNOWN: GOOD,
    NumberLevel.GOOD: GOOD,
    NumberLevel.WARNING_LOW: Judgement(SeverityStyle.WARNING, "LOW"),
    NumberLevel.WARNING_HIGH: Judgement(SeverityStyle.WARNING, "HIGH"),
    NumberLevel.ERROR_LOW: Judgement(SeverityStyle.BAD, "TOO LOW"),
    NumberLevel.ERROR_HIGH: Judgement(SeverityStyle.BAD, "TOO HIGH"),
}
"""Total. A level from a newer gateway reads UNKNOWN, and is no reason for an alarm."""
TEXT_LEVELS: Final[Mapping[TextLevel, Judgement]] = {
    TextLevel.UNKNOWN: GOOD,
    TextLevel.GOOD: GOOD,
    TextLevel.WARNING: Judgement(SeverityStyle.WARNING, "WARNING"),
    TextLevel.ERROR: Judgement(SeverityStyle.BAD, "ERROR"),
}
"""Total, as above."""
BATTERY_FAULTS: Final[Mapping[str, str]] = {"battery.low": "LOW", "battery.out_of_range": "UNKNOWN"}
"""Words for the faults of a part, by their ids; so are the following."""
COMPUTER_BATTERY_FAULTS: Final[Mapping[str, str]] = {"platform.battery_low": "LOW"}
DISK_FAULTS: Final[Mapping[str, str]] = {"platform.disk": "FULL"}
COMPUTE_FAULTS: Final[Mapping[str, str]] = {
    "platform.temperature": "HOT",
    "platform.throttled": "HOT",
    "platform.memory": "FULL",
    **DISK_FAULTS,
}
NETWORK_FAULTS: Final[Mapping[str, str]] = {"platform.wifi": "WEAK"}
ORIENTATION_FAULTS: Final[Mapping[str, str]] = {"orientation.tilt": "TILTED"}
SHORT_ROOM_S: Final = 3600
"""For recordings, at the present rate: less counts as short for the recorder, too. It is never worse than a
warning, because the recorder may go on for ever by deleting the oldest."""


def worst(judgements: Iterable[Judgement]) -> Judgement:
    """Returns the most severe one, the first of equals."""
    return max(judgements, key=lambda one: _ORDER.index(one.style))


def with_faults(found: Judgement, faults: Iterable[Fault], words: Mapping[str, str]) -> Judgement:
    """Returns the judgement of a part, no better than its own active faults.

    Args:
        found: by its values.
        faults: of the robot.
        words: for those of the part, by their ids.
    """
    return no_better(found, ((fault.id, fault.severity) for fault in faults if fault.active), words)


def no_better(
    found: Judgement, active: Iterable[tuple[str, FaultSeverity]], words: Mapping[str, str]
) -> Judgement:
    """Returns the judgement of a part, no better than the active faults that are its own.

    Args:
        found: by its values.
        active: faults of the robot, by their ids.
        words: for those of the part.
    """
    own = (Judgement(FAULT_STYLES[severity], words[each]) for each, severity in active if each in words)
    return worst((found, *own))


def of_battery(battery: results.Battery) -> Judgement:
    """Judges the charge; one that is being charged is at most a warning."""
    if battery.present is False:
        return Judgement(SeverityStyle.QUIET, "")
    found = CHARGE_PERCENT.judge(battery.charge_percent)
    if battery.charging and found.style is SeverityStyle.BAD:
        return Judgement(SeverityStyle.WARNING, found.word)
    return found


def of_compute(compute: results.Compute) -> Judgement:
    """Judges load, temperature, memory and disk."""
    return worst(
        (
            Judgement(SeverityStyle.WARNING, "HOT") if compute.thermal_throttled else GOOD,
            TEMPERATURE_C.judge(compute.cpu_temperature_c),
            MEMORY_PERCENT.judge(compute.ram_used_percent),
            DISK_PERCENT.judge(compute.disk_used_percent),
            CPU_PERCENT.judge(compute.cpu_percent),
        )
    )


def of_network(network: results.Network) -> Judgement:
    """Judges the connection and the strength of the signal."""
    if network.connected is False:
        return Judgement(SeverityStyle.BAD, "DOWN")
    return WIFI_DBM.judge(network.wifi_signal_dbm)


def of_position(position: results.Position) -> Judgement:
    """Judges whether there is a position at all."""
    return GOOD if position.latitude_deg is not None else Judgement(SeverityStyle.WARNING, "NO FIX")


def of_orientation(orientation: results.Orientation) -> Judgement:
    """Judges whether the angles are known."""
    return GOOD if orientation.roll_deg is not None else Judgement(SeverityStyle.WARNING, "UNKNOWN")


def of_number(number: results.NumberValue) -> Judgement:
    """Returns the robot's own judgement, by the limits of its configuration."""
    if number.value is None:
        return Judgement(SeverityStyle.WARNING, "UNKNOWN")
    return NUMBER_LEVELS[number.level]


def of_text(text: results.TextValue) -> Judgement:
    """Returns the robot's own judgement, by the levels of its configuration."""
    if text.text is None:
        return Judgement(SeverityStyle.WARNING, "UNKNOWN")
    return TEXT_LEVELS[text.level]


def of_video(measured: results.PreviewMeasurement) -> Judgement:
    """Judges loss and round trip of the worst viewer."""
    return worst(
        (LOSS_PERCENT.judge(measured.worst_loss_percent), ROUND_TRIP_MS.judge(measured.worst_rtt_ms))
    )


def of_recorder(recorder: results.RecordingStatus) -> Judgement:
    """Judges whether it can record, and the room that is left."""
    if recorder.state is RecorderState.FAULTED:
        return Judgement(SeverityStyle.BAD, "CAN'T RECORD")
    if recorder.state in _ROOM_UNKNOWN:
        return GOOD
    if not recorder.room_bytes:
        return Judgement(SeverityStyle.WARNING, "NO ROOM")
    if recorder.room_s is not None and recorder.room_s < SHORT_ROOM_S:
        return Judgement(SeverityStyle.WARNING, "LOW ROOM")
    return GOOD
