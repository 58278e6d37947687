"""The cursor: the bounds of the batch that was sent last, in a file beside the database.

It is written before a batch is sent, and replaced by the next one. What comes before it was delivered; it
alone may or may not have been. It is not in the database, so that a damaged one costs what had not been sent,
and no more.
"""

from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bridge.outbox.errors import OutboxError
from common.errors import UserError
from common.private_files import write_private

NAME: Final = "cursor.json"


class Cursor(BaseModel):
    """The newest batch. `last_id` is 0 before the first one."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    outbox: str
    """Names the database that it belongs to."""
    run_id: str = ""
    first: int = Field(default=0, ge=0)
    last: int = Field(default=0, ge=0)
    first_id: int = Field(default=0, ge=0)
    last_id: int = Field(default=0, ge=0)


def read_cursor(directory: Path) -> Cursor | None:
    """Returns the cursor; None if it is missing or damaged.

    Raises:
        OutboxError: the disk can't read it.
    """
    try:
        return Cursor.model_validate_json((directory / NAME).read_bytes())
    except (FileNotFoundError, ValidationError):
        return None
    except OSError as error:
        raise OutboxError(f"{directory / NAME} can't be read: {error.strerror}") from error


def remove_leftovers(directory: Path) -> None:
    """Removes the unfinished cursors of bridges that were killed; for the only user of the directory.

    Raises:
        OSError: the disk refuses.
    """
    for path in directory.glob(f".{NAME}.*"):
        path.unlink(missing_ok=True)


def write_cursor(directory: Path, cursor: Cursor) -> None:
    """Replaces the cursor; it is on the disk when this returns.

    Raises:
        OutboxError: the disk is full or fails.
    """
    try:
        write_private(directory / NAME, cursor.model_dump_json().encode())
    except UserError as error:
        raise OutboxError(error.what) from error
