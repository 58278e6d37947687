"""Single values of the outbox's database: whose it is, where it stands, what it has counted."""

import sqlite3
from typing import Any


def get(db: sqlite3.Connection, key: str) -> Any:
    """Returns a value; None if it was never set."""
    row = db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
    return row[0] if row else None


def put(db: sqlite3.Connection, key: str, value: str | int) -> None:
    """Sets a value."""
    db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))


def count(db: sqlite3.Connection, key: str, more: int) -> None:
    """Adds to a number."""
    if more:
        put(db, key, (get(db, key) or 0) + more)
