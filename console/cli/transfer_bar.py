"""The progress bar of a recording that is copied: rate, time left, and why nothing goes on at the moment."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

from console.client import ExportProgress, RecordingCopyState, UploadProgress


class TransferBar:
    """A progress bar, to be used in a `with` block.

    Args:
        out: Where it is drawn.
        shown: Whether it is; in a pipe it never is.
    """

    def __init__(self, out: Console, *, shown: bool) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            DownloadColumn(),
            TransferSpeedColumn(),
            TimeRemainingColumn(compact=True),
            console=out,
            disable=not (shown and out.is_terminal),
            transient=True,
            refresh_per_second=4,
        )
        self._task = self._progress.add_task("", total=None)

    def show_export(self, progress: ExportProgress) -> None:
        """Shows how far a copy to this computer is."""
        number = f"file {progress.number} of {progress.files}"
        self._show(number, progress.waiting, progress.done, progress.total)

    def show_upload(self, progress: UploadProgress) -> None:
        """Shows how far a copy to the fleet's store is."""
        copy = progress.copy
        waiting = "" if copy.state is RecordingCopyState.UPLOADING else progress.waiting
        self._show(copy.state.value, waiting, copy.bytes_done, progress.size)

    def _show(self, what: str, waiting: str, done: int, total: int) -> None:
        description = f"waiting: {waiting}" if waiting else what
        self._progress.update(self._task, description=description, completed=done, total=total or None)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()
