"""What a viewer did, for the end of a run: counted while it goes, told as a line and as JSON."""

import threading
import time
from dataclasses import dataclass
from typing import Any

from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.words import joined, plural

_MS_PER_S = 1000
_MIB = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """One run of a viewer. The keys of `robotctl view --json` are these; docs/robotctl.md lists them.

    Args:
        pictures: decoded.
        corrupt_pictures: of these, the ones the decoder had to guess parts of.
        width_px: of the newest picture; None without one, as the following.
        height_px: of the newest picture.
        codec: what it was compressed with.
        decoder: GStreamer's element that made it.
        first_picture_ms: from the start to the first picture.
        fps: pictures per second from the first to the last.
        redials: calls of the stream beyond the first.
        recording: what was kept; None when nothing was to be.
    """

    pictures: int
    corrupt_pictures: int
    width_px: int | None
    height_px: int | None
    codec: str | None
    decoder: str | None
    first_picture_ms: int | None
    fps: float | None
    redials: int
    recording: dict[str, Any] | None

    def line(self) -> str:
        """For people."""
        if self.pictures == 0:
            return joined("no picture", _kept(self.recording))
        return joined(
            plural(self.pictures, "picture"),
            f"{self.width_px}x{self.height_px} {self.codec} by {self.decoder}",
            f"first after {self.first_picture_ms} ms",
            f"{self.fps:.1f} fps" if self.fps else "",
            f"{self.corrupt_pictures} corrupt" if self.corrupt_pictures else "",
            f"called again {self.redials}x" if self.redials else "",
            _kept(self.recording),
        )


class Bookkeeper:
    """Counts pictures; `note` is called in the session's thread, the rest from anywhere."""

    def __init__(self) -> None:
        self._begun_s = time.monotonic()
        self._first_s = self._last_s = 0.0
        self._newest: Frame | None = None
        self._corrupt = 0
        self.pictures = 0
        """Noted so far."""
        self.news = threading.Condition()
        """Notified at every picture."""

    def note(self, frame: Frame) -> None:
        """Counts one picture."""
        with self.news:
            self._first_s = self._first_s or frame.arrival_s
            self._last_s, self._newest = frame.arrival_s, frame
            self._corrupt += frame.corrupt
            self.pictures += 1
            self.news.notify_all()

    @property
    def last_s(self) -> float:
        """When the newest picture came, or counting began, on `time.monotonic()`."""
        return self._last_s or self._begun_s

    def account(self, redials: int, recording: Recording | None) -> Account:
        """Everything counted so far."""
        with self.news:
            frame, lasted_s = self._newest, self._last_s - self._first_s
            return Account(
                pictures=self.pictures,
                corrupt_pictures=self._corrupt,
                width_px=frame.width if frame else None,
                height_px=frame.height if frame else None,
                codec=frame.codec if frame else None,
                decoder=frame.decoder if frame else None,
                first_picture_ms=round((self._first_s - self._begun_s) * _MS_PER_S) if frame else None,
                fps=round((self.pictures - 1) / lasted_s, 1) if lasted_s > 0 else None,
                redials=redials,
                recording=_recorded(recording),
            )


def _recorded(recording: Recording | None) -> dict[str, Any] | None:
    if recording is None:
        return None
    return {"file": str(recording.file), "bytes": recording.size_bytes, "gaps": recording.gaps}


def _kept(recording: dict[str, Any] | None) -> str:
    if recording is None:
        return ""
    gaps = f" with {plural(recording['gaps'], 'gap')}: the disk was too slow" if recording["gaps"] else ""
    return f"{recording['file']}: {recording['bytes'] / _MIB:.1f} MiB{gaps}"
