"""Commands of the hub in the outbox's database: each is carried out once, and its result kept until sent."""

import sqlite3
from typing import Final

_MOST_COMMANDS: Final = 1024
"""Commands that are remembered, so that none is carried out twice."""


def begin(db: sqlite3.Connection, command_id: str) -> bool:
    """Remembers a command; returns False if it is known already."""
    known = db.execute("SELECT 1 FROM commands WHERE command_id = ?", (command_id,)).fetchone()
    if known is None:
        db.execute("INSERT INTO commands (command_id) VALUES (?)", (command_id,))
        db.execute(
            "DELETE FROM commands WHERE sent = 1 AND id <= (SELECT max(id) FROM commands) - ?",
            (_MOST_COMMANDS,),
        )
    return known is None


def end(db: sqlite3.Connection, command_id: str, result: bytes) -> None:
    """Keeps a result; a second one of the same command is ignored."""
    db.execute("INSERT OR IGNORE INTO commands (command_id) VALUES (?)", (command_id,))
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
