"""robotctl record: recordings on the robot, and their copies on this computer."""

import asyncio
import shlex
import sys
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Group
from rich.text import Text

from common.errors import ExitCode, UserError
from console.cli.export_options import naming_export_options
from console.cli.recording_tables import exported_json, exported_text, recording_view, recordings_table
from console.cli.session import Session, print_json, with_session
from console.cli.transfer_bar import TransferBar
from console.cli.typed_options import typed_options
from console.client import ExportOptions, GatewayClient, RecordingCopyState
from console.client.export_path import path_below
from console.client.results import RecordingCopy
from console.presentation.json_form import json_form
from console.presentation.recording import (
    recording_summary,
)

_LEAST_LIMIT_MBIT: Final = 0.53
"""As the robot permits: 65536 bytes a second."""
_MOST_LIMIT_MBIT: Final = 1e6
_LONGEST_S: Final = (1 << 32) - 1
_LARGEST_MB: Final = ((1 << 64) - 1) // 1_000_000
"""What the fields of the request can say: uint32 and uint64 (bytes)."""
record_app = typer.Typer(
    help="Record on the robot, keep its last minutes, copy recordings to this computer.",
    add_completion=False,
    rich_markup_mode=None,
)

IdArgument = Annotated[
    str, typer.Argument(metavar="ID", help="The recording, as `robotctl record list` names it.")
]
LabelOption = Annotated[str, typer.Option("--label", metavar="TEXT", help="A name for people.")]
PresetOption = Annotated[
    str,
    typer.Option(
        "--preset", metavar="NAME", help="What to record.", show_default="the first one of the robot"
    ),
]


@record_app.command("start")
@with_session
def start(
    session: Session,
    *,
    label: LabelOption = "",
    notes: Annotated[str, typer.Option("--notes", metavar="TEXT", help="For people.")] = "",
    preset: PresetOption = "",
    video: Annotated[
        bool | None,
        typer.Option("--video/--no-video", help="With the video, or not.", show_default="as the preset says"),
    ] = None,
    max_s: Annotated[
        int,
        typer.Option(
            "--max-duration", metavar="SECONDS", min=0, max=_LONGEST_S, help="Stop by itself; 0: never."
        ),
    ] = 0,
    max_mb: Annotated[
        int,
        typer.Option("--max-size", metavar="MB", min=0, max=_LARGEST_MB, help="Stop by itself; 0: never."),
    ] = 0,
) -> None:
    """Start a recording on the robot's disk. It goes on when this computer leaves."""
    with session.connect() as gateway:
        answer = gateway.start_recording(
            label,
            notes=notes,
            preset=preset,
            with_video=video,
            max_duration_s=max_s,
            max_bytes=max_mb * 1_000_000,
        )
    session.show_answer(answer)


@record_app.command("stop")
@with_session
def stop(
    session: Session,
    *,
    recording_id: Annotated[
        str, typer.Argument(metavar="[ID]", help="The recording.", show_default="the one that runs")
    ] = "",
) -> None:
    """Stop a recording. Exit code 0 as well when it has ended before."""
    with session.connect() as gateway:
        answer = gateway.stop_recording(recording_id)
    session.show_answer(answer)


@record_app.command("snapshot")
@with_session
def snapshot(
    session: Session,
    *,
    label: LabelOption = "",
    before: Annotated[
        int | None,
        typer.Option(
            "--before",
            metavar="SECONDS",
            min=0,
            max=3600,
            help="Seconds until now.",
            show_default="the robot's",
        ),
    ] = None,
    after: Annotated[
        int | None,
        typer.Option(
            "--after",
            metavar="SECONDS",
            min=0,
            max=600,
            help="Seconds from now on.",
            show_default="the robot's",
        ),
    ] = None,
    preset: PresetOption = "",
) -> None:
    """Keep the last seconds, and the next ones. Ends at once; the robot completes it."""
    with session.connect() as gateway:
        answer = gateway.trigger_snapshot(label, pre_s=before, post_s=after, preset=preset)
    session.show_answer(answer)


@record_app.command("list")
@with_session
def list_all(session: Session) -> None:
    """List the recordings on the robot, the newest first."""
    with session.connect() as gateway:
        pages = tuple(gateway.recording_pages())
    status, recordings = pages[0].status, tuple(each for page in pages for each in page.recordings)
    document = {"status": json_form(status), "recordings": json_form(recordings)}
    summary = Text(f"{status.state.value.upper()}  {recording_summary(status, compact=False)}", style="dim")
    session.show(document, Group(recordings_table(recordings), Text(), summary) if recordings else summary)


@record_app.command("show")
@with_session
def show(session: Session, *, recording_id: IdArgument) -> None:
    """Show a recording with its files and its gaps."""
    with session.connect() as gateway:
        found = gateway.recording(recording_id)
    session.show(json_form(found), recording_view(found))


@record_app.command("pin")
@with_session
def pin(session: Session, *, recording_id: IdArgument) -> None:
    """Pin a recording: making room never deletes it."""
    _pin(session, recording_id, pinned=True)


@record_app.command("unpin")
@with_session
def unpin(session: Session, *, recording_id: IdArgument) -> None:
    """End the pin of a recording."""
    _pin(session, recording_id, pinned=False)


@record_app.command("delete")
@with_session
def delete(
    session: Session,
    *,
    recording_id: IdArgument,
    force: Annotated[
        bool,
        typer.Option("--force", help="Although it is pinned or not copied yet; for administrators."),
    ] = False,
) -> None:
    """Delete a recording from the robot's disk, as it is now: one that changes meanwhile stays."""
    with session.connect() as gateway:
        found = gateway.recording(recording_id)
        deleted = gateway.delete_recording(recording_id, expected_sha256=found.sha256, force=force)
    session.show_answer(deleted)


@record_app.command("export")
@with_session
def export(
    session: Session,
    *,
    recording_id: IdArgument,
    to: Annotated[
        Path, typer.Option("--to", metavar="DIR", help="Where its folder is made.", show_default="here")
    ] = Path(),
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what an earlier export has left.")
    ] = False,
    limit_mbit: Annotated[
        float,
        typer.Option(
            "--limit",
            metavar="MBIT/S",
            min=0,
            max=_MOST_LIMIT_MBIT,
            help="Highest rate; 0: as the robot is configured.",
        ),
    ] = 0,
) -> None:
    """Copy a recording to this computer, into the folder DIR/ID, and verify it.

    It goes on by itself when the connection was cut. Of a recording that is still written, it copies what is
    final so far.
    """
    if 0 < limit_mbit < _LEAST_LIMIT_MBIT:
        raise UserError(
            f"--limit {limit_mbit:g} is too low: a copy that takes so long would keep its place from others",
            f"Choose at least {_LEAST_LIMIT_MBIT:g} Mbit/s",
            exit_code=ExitCode.USAGE,
        )
    try:
        asyncio.run(_export(session, recording_id, to, resume=resume, limit_mbit=limit_mbit))
    except KeyboardInterrupt:
        limit = ["--limit", f"{limit_mbit:g}"] if limit_mbit else []
        words = ["record", "export", recording_id, "--to", str(to), "--resume", *limit]
        hint = f"What was received stays. To go on, type: robotctl {shlex.join(words)}"
        print(typed_options(sys.argv[1:]).repeated_in(hint), file=sys.stderr)
        raise


@record_app.command("upload")
@with_session
def upload(
    session: Session,
    *,
    recording_id: IdArgument,
    wait: Annotated[
        bool, typer.Option("--wait", help="Until it is verified there, with a progress bar.")
    ] = False,
) -> None:
    """Have the robot copy a recording to its fleet's store. It goes on when this computer leaves.

    With --wait exit code 1 when the copy is cancelled.
    """
    with session.connect() as gateway:
        answer = gateway.upload_recording(recording_id)
        if not wait:
            session.show_answer(answer)
            return
        try:
            copy = _followed(session, gateway, recording_id, answer.copy)
        except KeyboardInterrupt:
            print("The robot goes on copying it. How far it is: robotctl record list", file=sys.stderr)
            raise
    if copy.state is not RecordingCopyState.VERIFIED:
        remedy = f"Type: robotctl record upload {recording_id}"
        raise UserError(f"the copy of {recording_id} was cancelled", remedy)
    message = f"{recording_id} is in the fleet's store, verified"
    session.show({"ok": True, "message": message, "copy": json_form(copy)}, message)


def _followed(
    session: Session, gateway: GatewayClient, recording_id: str, copy: RecordingCopy
) -> RecordingCopy:
    """Shows the progress of a copy; returns it when it is verified or cancelled."""
    if copy.state is RecordingCopyState.VERIFIED:
        return copy
    with TransferBar(session.out, shown=not session.as_json) as bar:
        for progress in gateway.upload_progress(recording_id):
            bar.show_upload(progress)
            copy = progress.copy
    return copy


@record_app.command("cancel-upload")
@with_session
def cancel_upload(session: Session, *, recording_id: IdArgument) -> None:
    """End copying a recording to the fleet's store. A copy that is verified stays."""
    with session.connect() as gateway:
        answer = gateway.cancel_upload(recording_id)
    session.show_answer(answer)


async def _export(session: Session, recording_id: str, to: Path, *, resume: bool, limit_mbit: float) -> None:
    async with session.connect_async() as client:
        found = await client.recording(recording_id)
        folder = path_below(to, found.id)
        with TransferBar(session.out, shown=not session.as_json) as bar, naming_export_options():
            done = await client.export_recording(
                found,
                folder,
                ExportOptions(
                    resume=resume, max_bytes_per_s=round(limit_mbit * 1e6 / 8), progress=bar.show_export
                ),
            )
    if session.as_json:
        print_json(session.out, {"ok": True, **exported_json(done)})
    else:
        session.out.print(exported_text(done, found))


def _pin(session: Session, recording_id: str, *, pinned: bool) -> None:
    with session.connect() as gateway:
        answer = gateway.pin_recording(recording_id, pinned)
    session.show_answer(answer)
