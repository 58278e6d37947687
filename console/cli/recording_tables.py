"""What `robotctl record` prints of recordings, as tables and as JSON."""

from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from console.cli.tables import grid
from console.client import Recording
from console.client.exporting import ExportedRecording
from console.presentation.cloud import copy_text
from console.presentation.formatting import age, joined, plural, size, wall_clock
from console.presentation.recording import exported, is_written, recording_state, remarks


def recordings_table(recordings: tuple[Recording, ...]) -> Table:
    """Returns the list of a robot's recordings."""
    table = grid("nowrap", "nowrap", "nowrap", "right", "right", "nowrap", "fold", "fold")
    table.add_row("id", "began", "state", "length", "size", "copy", "label", "", style="dim")
    for each in recordings:
        table.add_row(
            Text(each.id),
            Text(wall_clock(each.started_unix_ms)),
            Text(recording_state(each)),
            age(each.duration_ms),
            size(each.size),
            Text(copy_text(each.copy, each.size)),
            Text(each.label or each.preset),
            Text(remarks(each), style="dim"),
        )
    return table


def recording_view(recording: Recording) -> RenderableType:
    """Returns a recording with its files and its gaps."""
    facts = grid("nowrap", "fold")
    ended = wall_clock(recording.ended_unix_ms) if recording.ended_unix_ms else "still written"
    for label, text in (
        ("label", recording.label),
        ("notes", recording.notes),
        ("state", recording_state(recording)),
        ("preset", recording.preset),
        ("began", wall_clock(recording.started_unix_ms)),
        ("ended", ended),
        ("length", age(recording.duration_ms)),
        ("size", size(recording.size)),
        ("messages", f"{recording.messages_written}, {_losses(recording)}"),
        ("video", plural(recording.video_frames, "frame") if recording.video_frames else "none"),
        ("", remarks(recording)),
        ("copy", joined(copy_text(recording.copy, recording.size), recording.copy.reason)),
    ):
        if text:
            facts.add_row(Text(label, style="dim"), Text(text))
    files = grid("fold", "right", "nowrap")
    for file in recording.files:
        files.add_row(Text(file.name), size(file.size), Text("" if file.final else "still written"))
    gaps = grid("nowrap", "nowrap", "fold")
    for gap in recording.gaps:
        began = wall_clock(gap.began_unix_ms, form="%Y-%m-%d %H:%M:%S")
        when = f"{began} to {wall_clock(gap.ended_unix_ms, form='%H:%M:%S %Z')}"
        gaps.add_row(
            Text("gap", style="bold yellow"), Text(when), f"{gap.cause.value}, {_lost(gap.messages)}"
        )
    return Group(Text(recording.id, style="bold"), Text(), facts, Text(), files, gaps)


def _losses(recording: Recording) -> str:
    """Returns what is missing in all; where gaps could not be counted, never that nothing is."""
    uncounted = recording.uncounted_gaps
    gaps = plural(uncounted, "gap") + " of unknown size" if uncounted else ""
    if gaps and recording.messages_lost == 0:
        return gaps
    return joined(_lost(recording.messages_lost), gaps)


def _lost(messages: int | None) -> str:
    return "losses unknown" if messages is None else f"{messages} lost"


def exported_json(done: ExportedRecording) -> dict[str, Any]:
    """Returns the JSON form of what was copied."""
    return {
        "folder": str(done.folder),
        "files": done.files,
        "size": done.size,
        "received": done.received,
        "cuts": done.cuts,
        "not_final": list(done.not_final),
    }


def exported_text(done: ExportedRecording, recording: Recording) -> str:
    """Returns what was exported, and what a recording that is still written has yet to give."""
    text = exported(done)
    if done.not_final or is_written(recording):
        rest = plural(len(done.not_final), "file")
        text += f"\nThe recording goes on: {rest} not final yet. Later, type the same with --resume"
    return text
