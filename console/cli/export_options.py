"""What robotctl adds to errors of an export: its options that help, which the client library has not."""

from collections.abc import Iterator
from contextlib import contextmanager

from common.errors import UserError
from console.client.exporting import FolderTakenError


@contextmanager
def naming_export_options() -> Iterator[None]:
    """Names --resume and --to where the block meets a folder that is there already.

    Raises:
        UserError: in place of `FolderTakenError`.
    """
    try:
        yield
    except FolderTakenError as error:
        raise UserError(
            error.what,
            "Go on with what an earlier export has left (--resume), or choose another folder (--to)",
            exit_code=error.exit_code,
        ) from error
