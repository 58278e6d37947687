"""One robot whole, as the hub has it: the rows of `robotctl fleet show`. Pure."""

from collections.abc import Iterator
from typing import Final

from console.client.results import DrivePhase, PreviewState, RecorderState
from console.fleet.columns import STANDING_STYLES, battery_cell, disk_cell, shortened
from console.fleet.values import FleetRow, RobotState, UploadBrief
from console.presentation.formatting import UNKNOWN, age, joined, plural, size
from console.presentation.health import health_style
from console.presentation.severity_style import (
    FAULT_STYLES,
    PREVIEW_STYLES,
    SeverityStyle,
)
from console.presentation.status_row import Look, Row
from console.presentation.status_table import number_rows, pose_rows, text_rows
from fleet.standing import Standing

_LONGEST_TEXT: Final = 200
"""Characters of a robot's own words in a row."""


def detail_rows(row: FleetRow) -> list[Row]:
    """Returns the rows of one robot, in the order of an operator's interest.

    What a robot that is not up has reported is marked as the last known.
    """
    look = Look(silent_ms=row.last_seen_ms or 0, outdated=row.standing is not Standing.UP)
    since = "" if row.since_ms is None else f"for {age(row.since_ms)}"
    standing = Row(
        "standing", row.standing.value.upper(), STANDING_STYLES[row.standing], row.problem or since
    )
    if row.state is None:
        return [standing]
    return [standing, *(_cut(each) for each in _of_state(row.state, look))]


def _of_state(state: RobotState, look: Look) -> Iterator[Row]:
    style = health_style(state.health, (fault.severity for fault in state.faults))
    yield look.state("health", state.health.value, style, state.summary)
    for fault in state.faults:
        text = fault.message or fault.fault_id
        yield look.present("fault", fault.severity.value, FAULT_STYLES[fault.severity], text)
    if state.fault_count > len(state.faults):
        more = plural(state.fault_count - len(state.faults), "fault")
        yield Row("", "more", SeverityStyle.WARNING, f"{more} that the state does not list")
    yield from _equipment(state, look)
    yield from pose_rows(state.position, state.orientation, look)
    yield from number_rows(state.numbers, look)
    yield from text_rows(state.texts, look)
    if state.values_left_out:
        more = plural(state.values_left_out, "value")
        yield Row("", "more", SeverityStyle.QUIET, f"{more} that the state does not list")
    yield from _transfers(state)
    versions = joined(
        f"gateway {state.gateway_version or UNKNOWN}", f"bridge {state.bridge_version or UNKNOWN}"
    )
    yield Row("software", "", SeverityStyle.QUIET, versions)
    if state.gateway_target:
        yield Row("reached at", "", SeverityStyle.QUIET, state.gateway_target)


def _equipment(state: RobotState, look: Look) -> Iterator[Row]:
    for label, cell in (("battery", battery_cell(state)), ("disk", disk_cell(state))):
        if cell.text != UNKNOWN:
            yield Row(label, "", cell.style or SeverityStyle.GOOD, cell.text)
    if state.mode:
        yield Row("mode", "", SeverityStyle.QUIET, state.mode)
    if state.preview is not PreviewState.UNKNOWN:
        yield look.state("preview", state.preview.value, PREVIEW_STYLES[state.preview], "")
    if state.drive is not DrivePhase.UNKNOWN:
        yield look.state("driving", state.drive.value, SeverityStyle.QUIET, "")
    if state.recorder is not RecorderState.UNKNOWN:
        faulted = state.recorder in (RecorderState.FAULTED, RecorderState.UNREACHABLE)
        style = SeverityStyle.BAD if faulted else SeverityStyle.QUIET
        waiting = (
            f"{plural(state.recordings_to_copy, 'recording')} to copy" if state.recordings_to_copy else ""
        )
        yield look.state("recorder", state.recorder.value, style, waiting)


def _transfers(state: RobotState) -> Iterator[Row]:
    for upload in state.uploads:
        yield Row("upload", upload.copy.state.value, SeverityStyle.QUIET, _upload(upload))
    if state.upload_count > len(state.uploads):
        more = plural(state.upload_count - len(state.uploads), "upload")
        yield Row("", "more", SeverityStyle.QUIET, f"{more} that the state does not list")
    if state.outbox_events or state.events_dropped:
        style = SeverityStyle.WARNING if state.events_dropped else SeverityStyle.QUIET
        dropped = f"{plural(state.events_dropped, 'event')} dropped" if state.events_dropped else ""
        yield Row("outbox", "", style, joined(f"{plural(state.outbox_events, 'event')} waiting", dropped))


def _upload(upload: UploadBrief) -> str:
    return joined(
        upload.recording_id,
        upload.label,
        f"{size(min(upload.copy.bytes_done, upload.size))} of {size(upload.size)}",
        f"{size(upload.bytes_per_s)}/s" if upload.bytes_per_s else "",
        upload.copy.reason or "",
    )


def _cut(row: Row) -> Row:
    return Row(row.label, row.mark, row.style, shortened(row.text, _LONGEST_TEXT), row.age, row.remedy)
