"""Recordings from a window: the list, its pictures, what operators request, and exports (exports.py).

Everything runs in the worker's loop. The list is requested when the recorder's state changes, and while it is
shown every ten seconds besides.

    a call is refused or fails      a note says why; the list is requested anew
    the role does not suffice       the same, and `denied` until other credentials are used
    the list can't be had           `problem` says why; what was listed stays
    a picture can't be had          the recording has none; after a lost connection it is requested again
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final, NoReturn, Protocol

from console.client import (
    GatewayError,
    Overloaded,
    Recording,
    RecordingStatus,
)
from console.client.results import (
    RecorderState,
    RecordingAnswer,
    RecordingDeleted,
    RecordingPage,
    RecordingThumbnail,
)
from console.monitor.calls import Calls
from console.monitor.exports import ExportingClient, Exports
from console.monitor.notes import Notes
from console.monitor.recordings_view import Change, ChangeRequest, ExportView, RecordingsView
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle

MOST_LISTED: Final = 200
"""One page of the contract. `robotctl record list` lists all."""
_LIST_EVERY_S: Final = 10.0
"""Without a change of the recorder's status: a copy elsewhere, for example, changes nothing of it."""
_LEAST_BETWEEN_LISTS_S: Final = 1.0
_LEAST_BETWEEN_PICTURES_S: Final = 0.1
_PICTURES_AGAIN_S: Final = 5.0
_UNLISTABLE: Final = (RecorderState.UNKNOWN, RecorderState.UNREACHABLE)
_ROLE_TOO_LOW: Final = "ROLE_TOO_LOW"
"""docs/errors.md"""


class RecordingClient(ExportingClient, Protocol):
    """The calls of `console.client.AsyncGatewayClient` that are made here."""

    async def list_recordings(self, page_size: int = ..., page_token: str = ...) -> RecordingPage:
        """Returns a page of the list."""

    async def start_recording(self, label: str = ..., *, preset: str = ...) -> RecordingAnswer:
        """Starts a recording."""

    async def stop_recording(self, recording_id: str = ...) -> RecordingAnswer:
        """Stops a recording."""

    async def trigger_snapshot(self, label: str = ..., *, pre_s: int | None = ...) -> RecordingAnswer:
        """Keeps the last seconds."""

    async def recording_thumbnail(self, recording_id: str) -> RecordingThumbnail:
        """Returns a key frame."""

    async def pin_recording(self, recording_id: str, pinned: bool = ...) -> RecordingAnswer:
        """Pins a recording, or ends that."""

    async def delete_recording(self, recording_id: str, *, expected_sha256: bytes = ...) -> RecordingDeleted:
        """Deletes a recording."""


_Call = Callable[[RecordingClient], Awaitable[RecordingAnswer | RecordingDeleted]]
"""Requests a change."""


class RecordingRobot(Protocol):
    """The client in use; another one after each change of the credentials."""

    @property
    def client(self) -> RecordingClient:
        """The client with the credentials in use."""


class Pictures(Protocol):
    """Makes pictures of key frames; `console.viewer.thumbnails.Thumbnails` does."""

    async def picture(
        self, recording: Recording, fetch: Callable[[], Awaitable[RecordingThumbnail]]
    ) -> bytes:
        """Returns the pixels; empty where none can be made. Raises a `GatewayError` of `fetch`."""


class Recordings:
    """Lists, changes and exports recordings. Thread-safe; nothing here waits.

    Args:
        call_soon: calls a function in the loop that runs `run`.
        on_change: called in that loop after each change of what `view` and `take_notes` return; must only
            hand over.
        connect: opens another connection to the robot, for an export.
        pictures: makes pictures of key frames; None for none.
    """

    _robot: RecordingRobot

    def __init__(
        self,
        call_soon: Callable[[Callable[[], object]], None],
        on_change: Callable[[], None],
        connect: Callable[[], AbstractAsyncContextManager[RecordingRobot]],
        pictures: Pictures | None = None,
    ) -> None:
        self._call_soon = call_soon
        self._on_change = on_change
        self._pictures = pictures
        self._view = RecordingsView()
        self._notes = Notes(on_change)
        self._calls = Calls(on_change)
        self._exports = Exports(connect, self._notes, self._update_exports)
        self._followed: object = None
        """What of the recorder's status says that its recordings have changed."""
        self._again_s: float | None = None
        """Time until the next list without a change; None for none."""
        self._listable, self._changed, self._shown_changed = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self._shown: tuple[Recording, ...] = ()
        self._denied_to: RecordingClient | None = None

    # --- any thread ---

    def view(self) -> RecordingsView:
        """Returns the present view."""
        return self._view

    def take_notes(self) -> list[Note]:
        """Returns the answers that were not taken yet."""
        return self._notes.take()

    def follow(self, status: RecordingStatus | None, *, shown: bool) -> None:
        """Takes the recorder's newest status; lists the recordings anew when they may have changed.

        Args:
            status: None while there is none that holds.
            shown: whether the list can be seen.
        """
        recorder = None
        if status and status.state not in _UNLISTABLE:
            recorder = (status.state, status.recording_id, status.recordings, status.snapshots_pending, shown)
        if recorder != self._followed:
            self._followed = recorder
            self._call_soon(partial(self._follow, recorder is not None, shown))

    def show_pictures(self, recordings: tuple[Recording, ...]) -> None:
        """Gets pictures for these recordings, which are the ones that can be seen."""
        if recordings != self._shown:
            self._shown = recordings
            self._call_soon(self._shown_changed.set)

    def start(self, label: str, preset: str) -> None:
        """Starts a recording."""
        self._request(ChangeRequest(Change.START), lambda robot: robot.start_recording(label, preset=preset))

    def stop(self, recording_id: str) -> None:
        """Stops the recording that was seen to run; another one goes on."""
        self._request(ChangeRequest(Change.STOP), lambda robot: robot.stop_recording(recording_id))

    def keep(self, label: str, seconds: int) -> None:
        """Keeps the last seconds."""
        self._request(ChangeRequest(Change.KEEP), lambda robot: robot.trigger_snapshot(label, pre_s=seconds))

    def pin(self, recording_id: str, pinned: bool) -> None:
        """Pins a recording, or ends that."""
        self._request(
            ChangeRequest(Change.PIN, recording_id), lambda robot: robot.pin_recording(recording_id, pinned)
        )

    def delete(self, recording: Recording) -> None:
        """Deletes a recording as it was listed: one that has changed since stays."""
        self._request(
            ChangeRequest(Change.DELETE, recording.id),
            lambda robot: robot.delete_recording(recording.id, expected_sha256=recording.sha256),
        )

    def export(self, recording_id: str, folder: Path) -> None:
        """Exports a recording, going on with what is there; no-op while another export runs."""
        self._call_soon(partial(self._exports.begin, recording_id, folder))

    def cancel_export(self) -> None:
        """Ends the export that runs; what was received stays."""
        self._call_soon(self._exports.cancel)

    # --- the loop ---

    async def run(self, robot: RecordingRobot) -> NoReturn:
        """Serves until cancelled: then calls and an export are cancelled. Raises only a defect of our own."""
        self._robot = robot
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._keep_list_current())
                tasks.create_task(self._keep_pictures_current())
        finally:
            self._calls.cancel()
            await self._exports.end()
        raise AssertionError("both go on for ever")

    def _follow(self, listable: bool, shown: bool) -> None:
        self._again_s = _LIST_EVERY_S if shown else None
        self._changed.set()
        if listable:
            self._listable.set()
        else:
            self._listable.clear()

    async def _keep_list_current(self) -> NoReturn:
        while True:
            await self._listable.wait()
            self._changed.clear()
            await self._list()
            await asyncio.sleep(_LEAST_BETWEEN_LISTS_S)
            with suppress(TimeoutError):
                async with asyncio.timeout(self._again_s):
                    await self._changed.wait()

    async def _list(self) -> None:
        if self._denied_to is not self._robot.client:
            self._update(denied="")
        try:
            page = await self._robot.client.list_recordings(MOST_LISTED)
        except GatewayError as error:
            self._update(problem=str(error))
            return
        listed = page.recordings[:MOST_LISTED]
        ids = {each.id for each in listed}
        pictures = {name: picture for name, picture in self._view.pictures.items() if name in ids}
        self._update(listed=listed, more=bool(page.next_page_token), problem="", pictures=pictures)

    async def _keep_pictures_current(self) -> NoReturn:
        while True:
            await self._shown_changed.wait()
            self._shown_changed.clear()
            if not await self._fetch_pictures():
                await asyncio.sleep(_PICTURES_AGAIN_S)
                self._shown_changed.set()

    async def _fetch_pictures(self) -> bool:
        """Gets the pictures that are missing. Returns False where the robot did not answer."""
        for recording in self._shown:
            if self._pictures is None or recording.id in self._view.pictures:
                continue
            fetch = partial(self._robot.client.recording_thumbnail, recording.id)
            try:
                picture = await self._pictures.picture(recording, fetch)
            except GatewayError as error:
                if not error.reason or isinstance(error, Overloaded):
                    return False
                # A refusal: it has no key frame, for example.
                picture = b""
            self._update(pictures={**self._view.pictures, recording.id: picture})
            await asyncio.sleep(_LEAST_BETWEEN_PICTURES_S)
            if self._shown_changed.is_set():
                break
        return True

    def _request(self, request: ChangeRequest, call: _Call) -> None:
        self._call_soon(partial(self._begin, request, call))

    def _begin(self, request: ChangeRequest, call: _Call) -> None:
        if request not in self._view.pending:
            self._calls.start(partial(self._carry_out, request, call))

    async def _carry_out(self, request: ChangeRequest, call: _Call) -> None:
        self._update(pending=self._view.pending | {request})
        client = self._robot.client
        try:
            self._notes.add((await call(client)).message, SeverityStyle.QUIET)
        except GatewayError as error:
            self._notes.add(str(error), SeverityStyle.BAD)
            if error.reason == _ROLE_TOO_LOW:
                self._denied_to = client
                self._update(denied=error.what)
        finally:
            self._update(pending=self._view.pending - {request})
            self._changed.set()

    def _update_exports(self, exports: Mapping[str, ExportView]) -> None:
        self._update(exports=exports)

    def _update(self, **changes: object) -> None:
        view = replace(self._view, **changes)  # type: ignore[arg-type]
        if view != self._view:
            self._view = view
            self._on_change()
