"""Generic values, which the robot's configuration names, as messages of the contract."""

from gateway.rpc.mapping.enums import NUMBER_LEVELS, TEXT_LEVELS
from gateway.status.faults.numbers import violation_of
from gateway.status.faults.texts import text_conditions, worst_severity
from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.snapshot import Snapshot
from gateway.status.sources import SourceSpec
from gateway.status.values import Number, Text
from omniseer.gateway.v1 import system_status_pb2, value_pb2


def fill_values(status: system_status_pb2.SystemStatus, snapshot: Snapshot) -> None:
    """Writes the generic values, in the order of the configuration."""
    for source in snapshot.sources:
        match source.spec.meaning:
            case NumberMeaning() as meaning:
                _fill_number(status.numbers.add(), source.spec, meaning, snapshot)
            case TextMeaning() as meaning:
                _fill_text(status.texts.add(), source.spec, meaning, snapshot)


def _fill_number(
    message: value_pb2.NumberStatus, spec: SourceSpec[Number], meaning: NumberMeaning, snapshot: Snapshot
) -> None:
    sample = snapshot[spec]
    value = sample.value.value if sample.value else None
    found = violation_of(spec, meaning, sample, snapshot.faults)
    message.label = spec.label or ""
    message.title = spec.display_name
    message.available, message.stale, message.age_ms = sample.freshness
    message.unit = meaning.unit
    message.tile = meaning.tile
    if value is not None:
        message.value = value
        message.level = value_pb2.NUMBER_LEVEL_GOOD
    if found:
        message.level = NUMBER_LEVELS[found.severity, found.side]
    if meaning.decimals is not None:
        message.decimals = meaning.decimals
    for name in ("error_below", "warning_below", "warning_above", "error_above"):
        if limit := getattr(meaning, name):
            setattr(message, name, limit.raise_at)


def _fill_text(
    message: value_pb2.TextStatus, spec: SourceSpec[Text], meaning: TextMeaning, snapshot: Snapshot
) -> None:
    sample = snapshot[spec]
    text = sample.value.text if sample.value else None
    severity = worst_severity(text_conditions(spec, meaning, sample, snapshot.faults))
    message.label = spec.label or ""
    message.title = spec.display_name
    message.available, message.stale, message.age_ms = sample.freshness
    message.tile = meaning.tile
    if text is not None:
        message.text = text
        message.level = value_pb2.TEXT_LEVEL_GOOD
    if severity:
        message.level = TEXT_LEVELS[severity]
