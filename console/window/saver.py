"""Saves the picture with its status, and the listed events, in the background."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Final

from PySide6.QtCore import QObject, QStandardPaths
from PySide6.QtGui import QImage

from console.monitor.event_filter import as_json_lines
from console.monitor.event_log import EventLine
from console.monitor.monitor_state import MonitorState
from console.monitor.saved_picture import file_stem, picture_record
from console.presentation.formatting import plural
from console.presentation.picture_age import PictureAge
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.window.background import BackgroundJob

_BUSY: Final = Note("Not saved: the previous file is still being written", SeverityStyle.WARNING)
_NO_PICTURE: Final = Note("Not saved: there is no picture", SeverityStyle.WARNING)


def folder() -> Path:
    """Returns where files are saved: the folder "robotctl" in the desktop's folder for pictures."""
    pictures = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.PicturesLocation)
    return Path(pictures) / "robotctl"


class Saver(QObject):
    """Writes one thing at a time.

    Args:
        parent: owns this object.
        show: shows a note to the operator.
    """

    def __init__(self, parent: QObject, show: Callable[[Note], None]) -> None:
        super().__init__(parent)
        self._show = show
        self.job = BackgroundJob(self)
        self.job.done.connect(show)

    def save_picture(self, image: QImage | None, state: MonitorState, age: PictureAge | None) -> None:
        """Saves the picture, without what lies over it, and the status of this moment."""
        if image is None:
            self._show(_NO_PICTURE)
            return
        at = datetime.now().astimezone()
        size = image.width(), image.height()
        record = picture_record(state, time.monotonic(), at, size, age)
        self._start(partial(_write_picture, _stem(state, at), image, record))

    def export_events(self, events: Sequence[EventLine], state: MonitorState) -> None:
        """Saves events as JSON, one on each line."""
        at = datetime.now().astimezone()
        file = _stem(state, at).with_suffix(".events.jsonl")
        what = plural(len(events), "event")
        self._start(partial(_write_text, file, as_json_lines(events), what))

    def _start(self, job: Callable[[], Note]) -> None:
        if not self.job.start(job):
            self._show(_BUSY)


def _stem(state: MonitorState, at: datetime) -> Path:
    return folder() / file_stem(state.snapshot.status.gateway_name if state.snapshot else "", at)


def _write_picture(stem: Path, image: QImage, record: Mapping[str, Any]) -> Note:
    picture = stem.with_suffix(".png")
    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        if not image.save(str(picture)):
            return _failed(f"{picture} can't be written")
    except OSError as error:
        return _failed(str(error))
    written = _write_text(
        stem.with_suffix(".json"),
        json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False),
        "the status",
    )
    good = written.style is SeverityStyle.GOOD
    return Note(f"Saved {picture} and its status", SeverityStyle.GOOD) if good else written


def _write_text(file: Path, text: str, what: str) -> Note:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        return _failed(str(error))
    return Note(f"Saved {what} to {file}", SeverityStyle.GOOD)


def _failed(why: str) -> Note:
    return Note(f"Not saved: {why}", SeverityStyle.BAD)
