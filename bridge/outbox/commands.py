"""Commands of the hub in the outbox's database: each is carried out once, and its result kept until sent.

How many commands there are, and whether their results are ever taken, is up to the hub: only the newest are
kept.
"""

import logging
import sqlite3
from typing import Final

_log = logging.getLogger(__name__)

MOST_COMMANDS: Final = 1024
"""Commands that are remembered, so that none is carried out twice."""


def restore(db: sqlite3.Connection) -> None:
    """Ends commands that a bad disk has changed: they have no result that can be sent, or no ID for it.

    One without an ID stays as it is; once it has ended, it is not reported again.
    """
    changed = db.execute(
        "UPDATE commands SET result = x'', sent = 1 WHERE (typeof(result) NOT IN ('null', 'blob')"
        " OR typeof(command_id) <> 'text' OR command_id GLOB '*[^A-Za-z0-9]*')"
        " AND NOT (result IS x'' AND sent IS 1)"
    )
    if changed.rowcount:
        _log.error("commands that the disk has changed get no result: %d", changed.rowcount)


def begin(db: sqlite3.Connection, command_id: str) -> bool:
    """Remembers a command; returns False if it is known already."""
    known = db.execute("SELECT 1 FROM commands WHERE command_id = ?", (command_id,)).fetchone()
    if known is None:
        _add(db, command_id)
    return known is None


def end(db: sqlite3.Connection, command_id: str, result: bytes) -> None:
    """Keeps a result; a second one of the same command is ignored."""
    _add(db, command_id)
    db.execute("UPDATE commands SET result = ? WHERE command_id = ? AND result IS NULL", (result, command_id))


def unanswered(db: sqlite3.Connection) -> list[str]:
    """Returns those without a result, the oldest first."""
    rows = db.execute("SELECT command_id FROM commands WHERE result IS NULL ORDER BY id")
    return [str(row[0]) for row in rows]


def next_result(db: sqlite3.Connection) -> tuple[str, bytes] | None:
    """Returns the oldest result that has not been sent, with its command; None if there is none."""
    row = db.execute(
        "SELECT command_id, result FROM commands WHERE result IS NOT NULL AND sent = 0 ORDER BY id LIMIT 1"
    ).fetchone()
    return (str(row[0]), bytes(row[1])) if row else None


def result_sent(db: sqlite3.Connection, command_id: str) -> None:
    """Notes that a result was sent."""
    db.execute("UPDATE commands SET sent = 1 WHERE command_id = ?", (command_id,))


def _add(db: sqlite3.Connection, command_id: str) -> None:
    """Adds a command that is not known yet, and forgets old ones, but none that is being carried out."""
    db.execute("INSERT OR IGNORE INTO commands (command_id) VALUES (?)", (command_id,))
    forgotten = db.execute(
        "DELETE FROM commands WHERE result IS NOT NULL AND id <= (SELECT max(id) FROM commands) - ?"
        " RETURNING command_id, sent",
        (MOST_COMMANDS,),
    ).fetchall()
    for forgotten_id, sent in forgotten:
        if not sent:
            _log.warning(
                "the result of command %s is dropped: the hub has not taken it, and %d commands came since",
                forgotten_id,
                MOST_COMMANDS,
            )
