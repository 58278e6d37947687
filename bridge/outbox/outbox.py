"""The outbox for the event loop, which never waits for the disk: a thread of its own has the database."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from bridge.events.values import Batch, Item, Position
from bridge.outbox.database import Database, Facts
from bridge.outbox.errors import OutboxError
from common.broadcast import Broadcast

_log = logging.getLogger(__name__)
ResultT = TypeVar("ResultT")


class Outbox:
    """Made by `outbox`. Every call raises `OutboxError` where the disk does not do its part.

    Attributes:
        changes: notified after each change of what it holds, and of `error`.
        error: why the newest call failed, for people; empty after one that succeeded.
        refusals: calls that failed.
        results: of commands that were kept since the start.
    """

    def __init__(self, directory: Path, max_bytes: int) -> None:
        self._database = Database(directory, max_bytes)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="outbox")
        self.max_bytes = max_bytes
        self.changes = Broadcast()
        self.error = ""
        self.refusals = 0
        self.results = 0

    @property
    def facts(self) -> Facts:
        """What it holds, as of the newest call."""
        return self._database.facts

    async def position(self) -> Position | None:
        """Returns the position after the last event that it took; None if it is new."""
        await self._call(self._database.open)
        return self._database.facts.position

    async def lost(self) -> bool:
        """Returns whether the outbox before this one was lost, and nothing was added since."""
        return await self._call(self._database.is_new)

    async def append(self, items: Sequence[Item], after: Position | None, position: Position) -> None:
        """Adds items; see `Database.append`."""
        await self._call(self._database.append, items, after, position)

    async def next_batch(self) -> Batch | None:
        """Returns what is to be sent; see `Database.next_batch`."""
        return await self._call(self._database.next_batch)

    async def give_up(self, batch: Batch, sequences: Sequence[int]) -> None:
        """Puts gaps in the place of events; see `Database.give_up`."""
        await self._call(self._database.give_up, batch, sequences)

    async def delivered(self, batch: Batch, *, repeated: bool) -> None:
        """Deletes a batch; see `Database.delivered`."""
        await self._call(partial(self._database.delivered, batch, repeated=repeated))

    async def begin_command(self, command_id: str) -> bool:
        """Remembers a command; False if it is known."""
        return await self._call(self._database.begin_command, command_id)

    async def end_command(self, command_id: str, result: bytes) -> None:
        """Keeps a command's result until it is sent."""
        await self._call(self._database.end_command, command_id, result)
        self.results += 1
        self.changes.notify_all()

    async def unanswered_commands(self) -> list[str]:
        """Returns the commands without a result."""
        return await self._call(self._database.unanswered_commands)

    async def next_result(self) -> tuple[str, bytes] | None:
        """Returns the oldest result that has to be sent, with its command's ID."""
        return await self._call(self._database.next_result)

    async def result_sent(self, command_id: str) -> None:
        """Notes that the hub has a result."""
        await self._call(self._database.result_sent, command_id)

    async def upload_rows(self) -> list[str]:
        """Returns the rows of the uploads."""
        return await self._call(self._database.uploads)

    async def put_upload_row(self, recording_id: str, row: str) -> None:
        """Writes an upload's row."""
        await self._call(self._database.put_upload, recording_id, row)

    async def delete_upload_rows(self, recording_ids: Sequence[str]) -> None:
        """Deletes uploads' rows; see `Database.delete_uploads`."""
        await self._call(self._database.delete_uploads, recording_ids)

    async def close(self) -> None:
        """Closes the database and ends the thread."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._database.close)
        self._thread.shutdown(wait=False)

    async def _call(self, work: Callable[..., ResultT], *arguments: Any) -> ResultT:
        before = self.error, self.facts
        try:
            result = await asyncio.get_running_loop().run_in_executor(self._thread, work, *arguments)
        except OutboxError as error:
            self.refusals += 1
            if self.error != str(error):
                _log.error("%s", error)
            self.error = str(error)
            raise
        else:
            if self.error:
                _log.warning("the outbox can be used again")
            self.error = ""
            return result
        finally:
            if before != (self.error, self.facts):
                self.changes.notify_all()


@asynccontextmanager
async def outbox(directory: Path, max_bytes: int) -> AsyncIterator[Outbox]:
    """Yields an outbox, which is closed when the block ends.

    Args:
        directory: of its files.
        max_bytes: of them together.
    """
    kept = Outbox(directory, max_bytes)
    try:
        yield kept
    finally:
        await kept.close()
