"""The outbox's database file: opened, checked, moved aside when it is damaged. Used by one thread.

It stays within its bytes: the pages that hold data are bounded, and what does not fit is dropped (`append`);
the WAL is written back every MiB, and no transaction is larger than some hundred KiB.
"""

import logging
import secrets
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bridge.events.values import Batch, DropReason, Event, Gap, Item, Position
from bridge.outbox import commands, meta
from bridge.outbox.cursor import Cursor, read_cursor, remove_leftovers, write_cursor
from bridge.outbox.errors import OutboxError
from bridge.outbox.items import (
    batch_between,
    drop_oldest,
    examine,
    first_batch,
    insert,
    lose,
    newest_place,
    restore,
)
from bridge.outbox.schema import TABLES, VERSION
from common.private_files import make_directory

_log = logging.getLogger(__name__)

NAME: Final = "outbox.db"
DAMAGED_NAME: Final = "outbox.damaged.db"
RESERVE_BYTES: Final = 4 * 1024 * 1024
"""For the WAL, and for the pages that a transaction adds before it drops others."""
MOST_PROBES: Final = 1024
_PAGE_BYTES: Final = 4096
_CHECKPOINT_PAGES: Final = 256
_DAMAGED: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_SUFFIXES: Final = ("", "-wal", "-journal", "-shm")


@dataclass(frozen=True, slots=True)
class Facts:
    """What the outbox holds.

    Attributes:
        events: that wait.
        size: bytes of the pages with data.
        sent: events that the hub has acknowledged since the outbox was made.
        dropped: events that were dropped since then.
        position: after the last event that was taken; None in a new outbox.
    """

    events: int = 0
    size: int = 0
    sent: int = 0
    dropped: int = 0
    position: Position | None = None


class _DamagedError(Exception):
    """The database can't be used any more."""


class Database:
    """Opened by the first call, and again by the one after an error.

    Args:
        directory: for the database and its cursor; made if it is missing.
        max_bytes: of all files together.
    """

    def __init__(self, directory: Path, max_bytes: int) -> None:
        self._directory = directory
        self._path = directory / NAME
        self._most_pages = max((max_bytes - RESERVE_BYTES) // _PAGE_BYTES, 16)
        self._connection: sqlite3.Connection | None = None
        self._cursor = Cursor(outbox="")
        self._flight = 0
        """Row up to which a batch may have been sent; nothing up to it is changed."""
        self._facts = Facts()

    @property
    def facts(self) -> Facts:
        """What it holds, as of the last call that succeeded."""
        return self._facts

    def open(self) -> None:
        """Opens it now.

        Raises:
            OutboxError: it can't be used.
        """
        with self._use():
            pass

    def close(self) -> None:
        """Closes it; the next call opens it again."""
        connection, self._connection = self._connection, None
        if connection is None:
            return
        try:
            connection.close()
        except sqlite3.Error as error:
            _log.warning("%s can't be closed: %s", self._path, error)

    def append(self, items: Sequence[Item], after: Position | None, position: Position) -> None:
        """Adds items; they are on the disk when this returns. Drops others if there is no room.

        Args:
            items: what follows `after`, without a hole; no more than 256 KiB.
            after: the position that the database had, as far as its caller knows.
            position: after the last of them.

        Raises:
            OutboxError: nothing was changed. So it is where the database was made anew meanwhile, and has
                another position: what the lost one had would be missing without a gap.
        """
        with self._use() as db:
            if (here := _position(db)) != after:
                raise OutboxError(f"{self._path} was made anew meanwhile: {_where(here)}")
            for item in items:
                insert(db, item)
                meta.count(db, "events", isinstance(item, Event))
                if isinstance(item, Gap) and item.reason is DropReason.DISK:
                    meta.count(db, "dropped", item.count)
            meta.put(db, "run_id", position.run_id)
            meta.put(db, "sequence", position.sequence)
            meta.put(db, "lost", 0)
            while _pages(db) > self._most_pages and drop_oldest(db, self._flight):
                pass

    def drop_oldest(self) -> bool:
        """Drops one event as `append` does when there is no room. Returns False if there is nothing to drop.

        Raises:
            OutboxError: nothing was changed.
        """
        with self._use() as db:
            return drop_oldest(db, self._flight)

    def next_batch(self) -> Batch | None:
        """Returns the batch that is to be sent, the same one until it is delivered; None if there is none.

        Raises:
            OutboxError: it must not be sent.
        """
        with self._use() as db:
            if batch := self._in_flight(db):
                return batch
            batch = first_batch(db)
            if batch is None:
                return None
            cursor = self._cursor.model_copy(
                update={
                    "run_id": batch.run_id,
                    "first": batch.first,
                    "last": batch.last,
                    "first_id": batch.first_id,
                    "last_id": batch.last_id,
                }
            )
            write_cursor(self._directory, cursor)
            self._cursor, self._flight = cursor, batch.last_id
            return batch

    def give_up(self, batch: Batch, sequences: Sequence[int]) -> None:
        """Puts gaps in the place of events that can't be read any more. The batch keeps its bounds.

        It may have been sent when they were whole: so the gaps are of events that may have arrived.

        Args:
            batch: of `next_batch`, which returns it with the gaps from then on.
            sequences: of its events.

        Raises:
            OutboxError: nothing was changed.
        """
        with self._use() as db:
            if self._in_flight(db) == batch:  # Else the database was made anew meanwhile.
                lose(db, batch, sequences)

    def delivered(self, batch: Batch, *, repeated: bool) -> None:
        """Deletes a batch that the hub has.

        Where nothing is known of an earlier outbox, the gap for it may be refused as a repeat, because a
        batch of that outbox begins with the same sequence. It is then sent once more from the next sequence
        on: if all are refused, all have been delivered.

        Args:
            batch: of `next_batch`.
            repeated: whether the hub had it already.

        Raises:
            OutboxError: it stays, and is sent again.
        """
        head = batch.items[0]
        with self._use() as db:
            if self._in_flight(db) != batch:
                return  # The database was made anew meanwhile.
            if repeated and isinstance(head, Gap) and head.probes and len(batch.items) == 1:
                shorter = head.first if head.earlier else head.first + 1
                db.execute(
                    "UPDATE items SET first = ?, earlier = 0, probes = probes - 1 WHERE id = ?",
                    (shorter, batch.first_id),
                )
                db.execute("DELETE FROM items WHERE id = ? AND first > last", (batch.first_id,))
            else:
                db.execute("DELETE FROM items WHERE id <= ?", (batch.last_id,))
                meta.count(db, "sent", batch.events)
                meta.count(db, "events", -batch.events)
        self._flight = 0

    def is_new(self) -> bool:
        """Returns whether nothing was added since it was made, in the place of one that was lost."""
        with self._use() as db:
            return bool(meta.get(db, "lost"))

    def begin_command(self, command_id: str) -> bool:
        """Remembers a command before it is carried out. Returns False if it is known already.

        Raises:
            OutboxError: it must not be carried out.
        """
        with self._use() as db:
            return commands.begin(db, command_id)

    def end_command(self, command_id: str, result: bytes) -> None:
        """Keeps the result of a command until it is sent. A second result of the same command is ignored.

        Raises:
            OutboxError: nothing was changed.
        """
        with self._use() as db:
            commands.end(db, command_id, result)

    def unanswered_commands(self) -> list[str]:
        """Returns the commands that have been begun and have no result."""
        with self._use() as db:
            return commands.unanswered(db)

    def next_result(self) -> tuple[str, bytes] | None:
        """Returns the oldest result that has not been sent, with its command's ID; None if there is none."""
        with self._use() as db:
            return commands.next_result(db)

    def result_sent(self, command_id: str) -> None:
        """Notes that the hub has the result."""
        with self._use() as db:
            commands.result_sent(db, command_id)

    def uploads(self) -> list[str]:
        """Returns the rows of the uploads."""
        with self._use() as db:
            return [row[0] for row in db.execute("SELECT row FROM uploads ORDER BY recording_id")]

    def put_upload(self, recording_id: str, row: str) -> None:
        """Writes the row of an upload."""
        with self._use() as db:
            db.execute("INSERT OR REPLACE INTO uploads VALUES (?, ?)", (recording_id, row))

    def delete_uploads(self, recording_ids: Sequence[str]) -> None:
        """Deletes the rows of uploads, as far as there are any; no more than 64, which is one transaction."""
        with self._use() as db:
            db.executemany("DELETE FROM uploads WHERE recording_id = ?", [(each,) for each in recording_ids])

    @contextmanager
    def _use(self) -> Iterator[sqlite3.Connection]:
        """Opens the database if it is not, and makes one transaction of the block."""
        try:
            changes = self._connection.total_changes if self._connection else -1
            db = self._connection = self._connection or self._open()
            db.execute("BEGIN IMMEDIATE")
            yield db
            # Or it has just been opened.
            facts = self._read_facts(db) if db.total_changes != changes else self._facts
            db.execute("COMMIT")
            self._facts = facts
        except BaseException as error:
            # What the database has not taken is rolled back, and it is examined again when it is opened.
            self.close()
            if isinstance(error, sqlite3.DatabaseError) and not isinstance(error, sqlite3.ProgrammingError):
                raise OutboxError(_why(self._path, error)) from error
            if isinstance(error, OSError):
                what = f"{error.filename or self._path} can't be written: {error.strerror}"
                raise OutboxError(what) from error
            raise

    def _open(self) -> sqlite3.Connection:
        make_directory(self._directory)
        cursor = read_cursor(self._directory)
        try:
            existed = self._path.exists()
            db = self._connect()
            try:
                if existed or cursor:
                    self._check(db, cursor)
                    # The lock is held by now: no other bridge is at it.
                    remove_leftovers(self._directory)
                    return db
                return self._begin(db, cursor)
            except BaseException:
                db.close()
                raise
        except _DamagedError as error:
            _log.error("%s can't be used, and is moved aside: %s", self._path, error)
        except sqlite3.DatabaseError as error:
            if _code(error) not in _DAMAGED:
                raise
            _log.error("%s is damaged, and is moved aside: %s", self._path, error)
        self._move_aside()
        db = self._connect()
        try:
            return self._begin(db, cursor)
        except BaseException:
            db.close()
            raise

    def _connect(self) -> sqlite3.Connection:
        # Its thread is the only one, but not the one that made this object.
        db = sqlite3.connect(self._path, timeout=0, isolation_level=None, check_same_thread=False)
        # What a bad disk has changed need not be UTF-8. It is judged like any other text, not an error.
        db.text_factory = lambda text: text.decode(errors="replace")
        try:
            # The lock is held until the end, so that a second bridge is refused.
            db.execute("PRAGMA locking_mode = EXCLUSIVE")
            db.execute(f"PRAGMA page_size = {_PAGE_BYTES}")
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = FULL")
            db.execute(f"PRAGMA wal_autocheckpoint = {_CHECKPOINT_PAGES}")
            db.execute(f"PRAGMA max_page_count = {self._most_pages + RESERVE_BYTES // 2 // _PAGE_BYTES}")
        except BaseException:
            db.close()
            raise
        return db

    def _begin(self, db: sqlite3.Connection, cursor: Cursor | None) -> sqlite3.Connection:
        """Makes the tables, and what is known to be missing."""
        self._cursor, self._flight = Cursor(outbox=secrets.token_hex(8)), 0
        db.execute("BEGIN IMMEDIATE")
        for statement in TABLES.split(";\n"):
            db.execute(statement)
        meta.put(db, "outbox", self._cursor.outbox)
        meta.put(db, "lost", 1)
        if cursor and cursor.last_id:
            # Sent under the name of the batch that may have been delivered: refused if it was.
            reason = DropReason.OUTBOX_LOST
            gap = Gap(cursor.run_id, max(cursor.first, 1), cursor.last, reason, earlier=cursor.first == 0)
            insert(db, gap)
            meta.put(db, "run_id", cursor.run_id)
            meta.put(db, "sequence", cursor.last)
            self._cursor = cursor.model_copy(
                update={"outbox": self._cursor.outbox, "first_id": 1, "last_id": 1}
            )
            self._flight = 1
        db.execute(f"PRAGMA user_version = {VERSION}")
        db.execute("COMMIT")
        write_cursor(self._directory, self._cursor)
        return db

    def _check(self, db: sqlite3.Connection, cursor: Cursor | None) -> None:
        """Checks that the database is whole and belongs to the cursor; restores what is in flight."""
        version = db.execute("PRAGMA user_version").fetchone()[0]
        if version > VERSION:
            raise OutboxError(
                f"{self._path} was made by a newer robot-bridge: install that version, or move the file away"
            )
        if version == 0:
            raise _DamagedError("it has no tables")
        if (verdict := db.execute("PRAGMA integrity_check(1)").fetchone()[0]) != "ok":
            raise _DamagedError(str(verdict).splitlines()[0])
        if cursor is None:
            raise _DamagedError("its cursor is missing")
        if meta.get(db, "outbox") != cursor.outbox:
            raise _DamagedError("its cursor belongs to another one")
        newest = db.execute(
            "SELECT coalesce(max(CAST(seq AS INTEGER)), 0) FROM sqlite_sequence WHERE name = 'items'"
        ).fetchone()[0]
        if newest < cursor.last_id:
            raise _DamagedError("it is older than its cursor")
        db.execute("BEGIN IMMEDIATE")
        # What comes before the cursor was delivered.
        db.execute("DELETE FROM items WHERE id < ?", (cursor.first_id,))
        meta.restore_counts(db)
        commands.restore(db)
        found = examine(db)
        if found.not_as_written:
            restore(db)
        if not meta.position_makes_sense(db):
            raise _DamagedError("its position makes no sense")
        if found.senseless:
            raise _DamagedError("a row makes no sense")
        sent = (cursor.run_id, cursor.last) if cursor.last_id else None
        if (newest_place(db) or sent) not in (None, (meta.get(db, "run_id"), meta.get(db, "sequence"))):
            raise _DamagedError("its position is not the one after what it has")
        meta.put(db, "events", found.events)
        db.execute("COMMIT")
        self._cursor, self._flight = cursor, cursor.last_id
        batch = self._in_flight(db)
        if batch is None:
            self._flight = 0
        elif batch.last_id != cursor.last_id or batch.last != cursor.last:
            raise _DamagedError("the batch of its cursor is not whole")

    def _move_aside(self) -> None:
        for suffix in _SUFFIXES:
            path = self._path.with_name(NAME + suffix)
            aside = self._path.with_name(DAMAGED_NAME + suffix)
            aside.unlink(missing_ok=True)
            if path.exists():
                path.rename(aside)

    def _in_flight(self, db: sqlite3.Connection) -> Batch | None:
        return batch_between(db, self._cursor.first_id, self._flight)

    def _read_facts(self, db: sqlite3.Connection) -> Facts:
        return Facts(
            events=meta.get(db, "events") or 0,
            size=_pages(db) * _PAGE_BYTES,
            sent=meta.get(db, "sent") or 0,
            dropped=meta.get(db, "dropped") or 0,
            position=_position(db),
        )


def _position(db: sqlite3.Connection) -> Position | None:
    """Returns the position after the last event that was taken; None in a new outbox."""
    run_id = meta.get(db, "run_id")
    return None if run_id is None else Position(run_id, meta.get(db, "sequence"))


def _where(position: Position | None) -> str:
    if position is None:
        return "it begins with the gateway's next event"
    return f"it goes on after event {position.sequence}"


def _pages(db: sqlite3.Connection) -> int:
    """Returns the pages with data, also of the present transaction."""
    (pages,), (free,) = (db.execute(f"PRAGMA {each}").fetchone() for each in ("page_count", "freelist_count"))
    return int(pages) - int(free)


def _code(error: sqlite3.Error) -> int:
    """Returns the primary result code (sqlite.org/rescode.html)."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF


def _why(path: Path, error: sqlite3.Error) -> str:
    sentences = {
        sqlite3.SQLITE_CORRUPT: "it is damaged, and is made anew",
        sqlite3.SQLITE_BUSY: "another robot-bridge uses it",
        sqlite3.SQLITE_FULL: "the disk is full",
        sqlite3.SQLITE_READONLY: "it is read-only",
        sqlite3.SQLITE_CANTOPEN: "it can't be opened; check its folder's owner and permissions",
        sqlite3.SQLITE_IOERR: "the disk reports an error",
    }
    return f"{path} can't be used: {sentences.get(_code(error), str(error))}"
