"""The queue of uploads in the outbox's database: a row for each recording."""

import json
import logging
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from bridge.outbox.database import RESERVE_BYTES
from bridge.outbox.errors import OutboxError
from bridge.outbox.outbox import Outbox
from bridge.uploads.queue import MOST_KEPT, Priority, State, Upload

_log = logging.getLogger(__name__)

_ROW_BYTES: Final = 1024
"""Of a row on the disk: 400 with a short label, up to 1200 with the longest one."""
_DELETED_AT_ONCE: Final = 64
"""Rows in one transaction: each may change a page of its own."""


def most_kept(max_bytes: int) -> int:
    """Returns how many uploads that wait no more an outbox of so many bytes remembers.

    They take about a quarter of its room, so that events have theirs.
    """
    return min(MOST_KEPT, (max_bytes - RESERVE_BYTES) // 4 // _ROW_BYTES)


class StoredUploads:
    """Implements `UploadStore`.

    Args:
        outbox: has the database.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox

    async def uploads(self) -> list[Upload]:
        """Returns all rows; one that can't be understood is left out.

        What counts for one process only is as in a new `Upload`: `due_s`, `since_s`, `cuts`.

        Raises:
            OSError: the disk can't be read.
        """
        try:
            rows = await self._outbox.upload_rows()
        except OutboxError as error:
            raise OSError(str(error)) from error
        return [upload for row in rows if (upload := _upload(row))]

    async def put_upload(self, upload: Upload) -> None:
        """Writes a row; raises as `uploads`."""
        try:
            await self._outbox.put_upload_row(upload.recording_id, _row(upload))
        except OutboxError as error:
            raise OSError(str(error)) from error

    async def delete_uploads(self, recording_ids: Sequence[str]) -> None:
        """Deletes rows, some at a time; raises as `uploads`."""
        try:
            for first in range(0, len(recording_ids), _DELETED_AT_ONCE):
                await self._outbox.delete_upload_rows(recording_ids[first : first + _DELETED_AT_ONCE])
        except OutboxError as error:
            raise OSError(str(error)) from error


def _row(upload: Upload) -> str:
    values: dict[str, Any] = asdict(upload)
    # Of this run alone.
    del values["due_s"], values["since_s"], values["cuts"]
    if not upload.bundle:
        # An earlier version does not understand it, to which the robot may go back.
        del values["bundle"]
    values |= {
        "priority": upload.priority.name,
        "state": upload.state.name,
        "sha256": upload.sha256.hex(),
    }
    return json.dumps(values)


def _upload(row: str) -> Upload | None:
    try:
        values = json.loads(row)
        values["priority"] = Priority[values["priority"]]
        values["state"] = State[values["state"]]
        values["sha256"] = bytes.fromhex(values["sha256"])
        return Upload(**values)
    except (ValueError, KeyError, TypeError) as error:
        _log.warning("a row of the queue of uploads can't be understood: %s", error)
        return None
