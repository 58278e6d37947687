"""The items that wait in the outbox's database, in order: events, and gaps in the place of dropped ones."""

import sqlite3
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from bridge.events.values import Batch, DropReason, Event, Gap, Item
from bridge.outbox import meta

MOST_ITEMS: Final = 64
"""Of a batch."""
MOST_BYTES: Final = 256 * 1024
"""Of a batch, with its envelope."""
_ENVELOPE_BYTES: Final = 1024
_ITEM_BYTES: Final = 64
"""Of an item besides its payload."""
_COLUMNS: Final = "id, run_id, first, last, severity, payload, reason, earlier, probes"
_SENSE: Final = f"""
    typeof(run_id) = 'text' AND length(run_id) BETWEEN 1 AND 64 AND run_id NOT GLOB '*[^A-Za-z0-9_-]*'
    AND typeof(first) = 'integer' AND first >= 0
    AND (payload IS NOT NULL OR
      typeof(last) = 'integer' AND last >= first - 1
      AND typeof(earlier) = 'integer' AND typeof(probes) = 'integer'
      AND typeof(reason) = 'integer' AND reason BETWEEN 0 AND {max(DropReason)})
"""
"""What holds for each row that can be sent; bridge/events/encoding.py says more of an event's payload.

`restore` changes nothing of it: the rest of an event's row does not count, and the gap in its place has what
is asked here.
"""
_NOT_AS_WRITTEN: Final = """
    typeof(severity) <> 'integer'
    OR typeof(payload) NOT IN ('null', 'blob')
    OR (payload IS NOT NULL AND NOT (last IS first AND reason IS 0 AND earlier IS 0 AND probes IS 0))
"""
"""What holds for each row that `restore` changes."""
_NumberedGap = tuple[int, Gap]


class Examination(NamedTuple):
    """What is found in the rows.

    Attributes:
        events: how many there are, less those of which `restore` makes gaps.
        not_as_written: rows that `restore` changes.
        senseless: rows that can't be sent, which `restore` does not help.
    """

    events: int
    not_as_written: int
    senseless: int


def examine(db: sqlite3.Connection) -> Examination:
    """Examines all rows in one scan: an outbox may have some hundred thousand."""
    return Examination(
        *db.execute(
            "SELECT count(*) FILTER (WHERE typeof(payload) = 'blob'),"  # noqa: S608  # constants
            f" count(*) FILTER (WHERE {_NOT_AS_WRITTEN}), count(*) FILTER (WHERE NOT ({_SENSE})) FROM items"
        ).fetchone()
    )


def restore(db: sqlite3.Connection) -> None:
    """Undoes what a bad disk has done to columns that say nothing in their row; no checksum guards them.

    In an event's row that is all that only a gap has. An event whose payload can't be bytes becomes a gap.
    """
    db.execute("UPDATE items SET severity = 0 WHERE typeof(severity) <> 'integer'")
    lost = db.execute(
        "UPDATE items SET payload = NULL, last = first, reason = ?, earlier = 0, probes = 0"
        " WHERE typeof(payload) NOT IN ('null', 'blob')",
        (int(DropReason.OUTBOX_LOST),),
    )
    meta.count(db, "dropped", lost.rowcount)
    db.execute(
        "UPDATE items SET last = first, reason = 0, earlier = 0, probes = 0 WHERE payload IS NOT NULL"
        " AND NOT (last IS first AND reason IS 0 AND earlier IS 0 AND probes IS 0)"
    )


def newest_place(db: sqlite3.Connection) -> tuple[str, int] | None:
    """Returns the run of the newest item and the sequence at which it ends; None if there is none."""
    newest: tuple[str, int] | None = db.execute(
        "SELECT run_id, last FROM items ORDER BY id DESC LIMIT 1"
    ).fetchone()
    return newest


def insert(db: sqlite3.Connection, item: Item) -> None:
    """Adds an item at the end."""
    if isinstance(item, Event):
        values: tuple[Any, ...] = (
            item.run_id,
            item.first,
            item.last,
            item.severity,
            item.payload,
            0,
            0,
            0,
        )
    else:
        flags = (int(item.reason), int(item.earlier), item.probes)
        values = (item.run_id, item.first, item.last, item.worst, None, *flags)
    db.execute(
        "INSERT INTO items (run_id, first, last, severity, payload, reason, earlier, probes)"
        " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        values,
    )


def first_batch(db: sqlite3.Connection) -> Batch | None:
    """Returns the oldest items, as far as they make one batch; None if there are none."""
    return _batch_of(db.execute(f"SELECT {_COLUMNS} FROM items ORDER BY id LIMIT ?", (MOST_ITEMS,)))  # noqa: S608  # constants


def batch_between(db: sqlite3.Connection, first_id: int, last_id: int) -> Batch | None:
    """Returns the batch of these rows; None if there are none."""
    return _batch_of(
        db.execute(
            f"SELECT {_COLUMNS} FROM items WHERE id >= ? AND id <= ? ORDER BY id",  # noqa: S608  # constants
            (first_id, last_id),
        )
    )


def lose(db: sqlite3.Connection, batch: Batch, sequences: Iterable[int]) -> None:
    """Puts a gap in the place of each of these events of a batch."""
    for sequence in sequences:
        db.execute(
            "UPDATE items SET payload = NULL, reason = ?"
            " WHERE payload IS NOT NULL AND first = ? AND id BETWEEN ? AND ?",
            (int(DropReason.OUTBOX_LOST), sequence, batch.first_id, batch.last_id),
        )
        meta.count(db, "dropped", 1)
        meta.count(db, "events", -1)


def drop_oldest(db: sqlite3.Connection, flight: int) -> bool:
    """Puts a gap in the place of the oldest INFO, else of the oldest event; else joins old gaps.

    Args:
        db: in a transaction.
        flight: row up to which nothing may be changed.

    Returns:
        False if there is nothing left to drop.
    """
    for query in (
        "SELECT id FROM items WHERE payload IS NOT NULL AND severity <= 1 AND id > ? ORDER BY id LIMIT 1",
        "SELECT id FROM items WHERE payload IS NOT NULL AND id > ? ORDER BY id LIMIT 1",
    ):
        if row := db.execute(query, (flight,)).fetchone():
            _turn_into_gap(db, row[0], flight)
            return True
    return _join_oldest_gaps(db, flight)


def _turn_into_gap(db: sqlite3.Connection, row_id: int, flight: int) -> None:
    db.execute(
        "UPDATE items SET payload = NULL, reason = ? WHERE id = ?", (int(DropReason.OUTBOX_FULL), row_id)
    )
    meta.count(db, "dropped", 1)
    meta.count(db, "events", -1)
    here = _row(db, "id = ?", row_id)
    before = _row(db, "id < ? ORDER BY id DESC LIMIT 1", row_id)
    if here and before and before[0] > flight and _adjoin(before, here):
        here = _join(db, before, here)
    if here and (after := _row(db, "id > ? ORDER BY id LIMIT 1", here[0])) and _adjoin(here, after):
        _join(db, here, after)


def _join_oldest_gaps(db: sqlite3.Connection, flight: int) -> bool:
    """Joins the two oldest gaps; one of an earlier run goes, because the next run's says so."""
    here = _row(db, "id > ? ORDER BY id LIMIT 1", flight)
    after = here and _row(db, "id > ? ORDER BY id LIMIT 1", here[0])
    if not here or not after:
        return False
    if here[1].run_id == after[1].run_id:
        _join(db, here, after)
    else:
        db.execute("DELETE FROM items WHERE id = ?", (here[0],))
        db.execute("UPDATE items SET earlier = 1 WHERE id = ?", (after[0],))
    return True


def _batch_of(rows: sqlite3.Cursor) -> Batch | None:
    items: list[Item] = []
    ids: list[int] = []
    size = _ENVELOPE_BYTES
    for row in rows:
        item = _item(row)
        if items and not _follows(items[-1], item):
            break
        size += _ITEM_BYTES + (len(item.payload) if isinstance(item, Event) else 0)
        if items and size > MOST_BYTES:
            break
        items.append(item)
        ids.append(row[0])
    return Batch(tuple(items), ids[0], ids[-1]) if items else None


def _follows(before: Item, item: Item) -> bool:
    first_of_run = isinstance(item, Gap) and item.earlier
    return item.run_id == before.run_id and item.first == before.last + 1 and not first_of_run


def _item(row: Any) -> Item:
    _, run_id, first, last, severity, payload, reason, earlier, probes = row
    if payload is not None:
        return Event(run_id, first, severity, payload)
    return Gap(run_id, first, last, DropReason(reason), severity, bool(earlier), probes)


def _row(db: sqlite3.Connection, where: str, value: int) -> _NumberedGap | None:
    """Returns a gap with its number; None if the row is an event, or there is none."""
    row = db.execute(f"SELECT {_COLUMNS} FROM items WHERE {where}", (value,)).fetchone()  # noqa: S608  # constants
    item = _item(row) if row else None
    return (row[0], item) if isinstance(item, Gap) else None


def _adjoin(before: _NumberedGap, after: _NumberedGap) -> bool:
    return before[1].reason is after[1].reason is DropReason.OUTBOX_FULL and _follows(before[1], after[1])


def _join(db: sqlite3.Connection, before: _NumberedGap, after: _NumberedGap) -> _NumberedGap:
    """Makes one gap of two. Its severity is known if both are."""
    (row_id, first), (other_id, second) = before, after
    worst = max(first.worst, second.worst) if first.worst and second.worst else 0
    db.execute("DELETE FROM items WHERE id = ?", (other_id,))
    db.execute(
        "UPDATE items SET last = ?, severity = ?, reason = ?, probes = 0 WHERE id = ?",
        (second.last, worst, int(second.reason), row_id),
    )
    return row_id, Gap(first.run_id, first.first, second.last, second.reason, worst, first.earlier)
