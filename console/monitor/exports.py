"""Exports recordings from a window, one at a time.

An export has a connection of its own, so that neither status nor commands of a driver wait behind it. What
was received of one that fails or is cancelled stays, and another one goes on from there.
"""

import asyncio
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol

from common.errors import UserError
from console.client import ExportedRecording, ExportOptions, ExportProgress
from console.monitor.export_meter import ExportMeter
from console.monitor.notes import Notes
from console.monitor.recordings_view import ExportState, ExportView
from console.presentation.recording import exported
from console.presentation.severity_style import SeverityStyle

_MOST_EXPORTS: Final = 20
"""Whose ends are remembered."""
_ENDS_WITHIN_S: Final = 0.5


class ExportingClient(Protocol):
    """The call of `console.client.AsyncGatewayClient` that is made here."""

    async def export_recording(
        self, recording_id: str, folder: Path, options: ExportOptions | None = ...
    ) -> ExportedRecording:
        """Copies a recording to this computer."""


class ExportingRobot(Protocol):
    """A connection to the robot."""

    @property
    def client(self) -> ExportingClient:
        """Its client."""


class Exports:
    """The newest exports. Belongs to the worker's loop.

    Args:
        connect: opens another connection to the robot.
        notes: get how each one ended.
        on_change: called after each change with the exports by the recording's ID, the newest last.
    """

    def __init__(
        self,
        connect: Callable[[], AbstractAsyncContextManager[ExportingRobot]],
        notes: Notes,
        on_change: Callable[[Mapping[str, ExportView]], None],
    ) -> None:
        self._connect = connect
        self._notes = notes
        self._on_change = on_change
        self._views: Mapping[str, ExportView] = {}
        self._task: asyncio.Task[None] | None = None

    def begin(self, recording_id: str, folder: Path) -> None:
        """Exports a recording, going on with what is there; no-op while another export runs."""
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._export(recording_id, folder))

    def cancel(self) -> None:
        """Ends the export that runs."""
        if self._task:
            self._task.cancel()

    async def end(self) -> None:
        """Ends the export that runs, and waits for that for half a second."""
        if self._task:
            self._task.cancel()
            await asyncio.wait((self._task,), timeout=_ENDS_WITHIN_S)

    async def _export(self, recording_id: str, folder: Path) -> None:
        meter = ExportMeter()

        def progress(now: ExportProgress) -> None:
            now_s = time.monotonic()
            if meter.is_due(now_s) or now.waiting:
                rate = meter.read(now_s, now.done, now.total)
                self._show(recording_id, done=now.done, total=now.total, rate=rate, text=now.waiting)

        others = [(name, each) for name, each in self._views.items() if name != recording_id]
        begun = (recording_id, ExportView(folder=folder))
        self._set(dict([*others[1 - _MOST_EXPORTS :], begun]))
        try:
            async with self._connect() as robot:
                done = await robot.client.export_recording(
                    recording_id, folder, ExportOptions(progress=progress)
                )
        except UserError as error:
            self._show(recording_id, state=ExportState.FAILED, text=str(error))
            self._notes.add(f"Export failed: {error}", SeverityStyle.BAD)
        except asyncio.CancelledError:
            self._show(recording_id, state=ExportState.CANCELLED, text="")
            raise
        else:
            text = exported(done)
            self._show(recording_id, state=ExportState.DONE, done=done.size, total=done.size, text=text)
            self._notes.add(text, SeverityStyle.GOOD)

    def _show(self, recording_id: str, **changes: object) -> None:
        changed = replace(self._views[recording_id], **changes)  # type: ignore[arg-type]
        self._set({**self._views, recording_id: changed})

    def _set(self, views: Mapping[str, ExportView]) -> None:
        self._views = views
        self._on_change(views)
