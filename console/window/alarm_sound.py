"""Plays the alarm's sound without blocking the window."""

from collections.abc import Callable  # noqa: TC003  # read by the type checker alone

from PySide6.QtCore import QObject

from common.errors import UserError
from console.monitor.alarm import Alarm
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.receiver.tone import play_tone
from console.window.background import BackgroundJob


class AlarmSound(QObject):
    """Plays the tone whenever the alarm is due.

    Args:
        alarm: decides when.
        parent: owns this object.
    """

    def __init__(self, alarm: Alarm, parent: QObject) -> None:
        super().__init__(parent)
        self._alarm = alarm
        self.job = BackgroundJob(self)
        self.play: Callable[[], None] = play_tone
        """Plays the tone once; raises a `UserError` where it can't be heard."""

    def check(self, now_s: float) -> None:
        """Plays the tone if the alarm is due."""
        if self._alarm.due(now_s):
            self.job.start(self._play)

    def _play(self) -> Note | None:
        try:
            self.play()
        except UserError as error:
            return Note(str(error), SeverityStyle.WARNING)
        return None
