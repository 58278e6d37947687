"""Tables of the outbox's database."""

from typing import Final

VERSION: Final = 1
"""In SQLite's user_version. A newer one is not touched."""
TABLES: Final = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value) WITHOUT ROWID;
-- AUTOINCREMENT: the number of a row is never used again, so that the cursor can be compared with it.
CREATE TABLE items (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  run_id TEXT NOT NULL,
  first INTEGER NOT NULL,
  last INTEGER NOT NULL,
  severity INTEGER NOT NULL,
  payload BLOB,
  reason INTEGER NOT NULL,
  earlier INTEGER NOT NULL,
  probes INTEGER NOT NULL
);
CREATE INDEX expendable ON items (id) WHERE payload IS NOT NULL AND severity <= 1;
CREATE TABLE commands (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  command_id TEXT NOT NULL UNIQUE,
  result BLOB,
  sent INTEGER NOT NULL DEFAULT 0
);
CREATE TABLE uploads (recording_id TEXT PRIMARY KEY, row TEXT NOT NULL) WITHOUT ROWID;
"""
