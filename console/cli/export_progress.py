"""The progress bar of an export: rate, time left, and why nothing comes at the moment."""

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

from console.client import ExportProgress


class ExportBar:
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

    def update(self, progress: ExportProgress) -> None:
        """Shows how far it is."""
        number = f"file {progress.number} of {progress.files}"
        self._progress.update(
            self._task,
            description=f"waiting: {progress.waiting}" if progress.waiting else number,
            completed=progress.done,
            total=progress.total,
        )

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
