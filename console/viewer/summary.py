"""Summary of one run of a viewer, as a line for people and as JSON."""

import threading
import time
from dataclasses import dataclass
from typing import Any

from console.presentation.formatting import joined, plural
from console.receiver.delivery import Delivery
from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.formatting import delivery_text, mebibytes
from console.viewer.picture_meter import AgeSummary

_MS_PER_S = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewSummary:
    """One run of a viewer. The fields are the keys of `robotctl view --json`; docs/robotctl.md lists them.

    Args:
        pictures: decoded frames.
        corrupt_pictures: of these, the torn ones: `Frame.corrupt`.
        width_px: of the latest frame; None without one, like the following.
        height_px: of the latest frame.
        codec: of the latest frame.
        decoder: GStreamer's element that decoded it.
        first_picture_ms: from the start to the first frame.
        fps: frames per second from the first to the last.
        redials: how often the stream was connected to again after it was lost or fell silent.
        recording: file, bytes and gaps of the recording; None without one.
        delivery: how packets were delivered, with the figures of the latest connection; None without one.
        picture_age: ages of the last frames; None where the robot does not say when it captured them.
    """

    pictures: int
    corrupt_pictures: int
    width_px: int | None = None
    height_px: int | None = None
    codec: str | None = None
    decoder: str | None = None
    first_picture_ms: int | None = None
    fps: float | None = None
    redials: int
    recording: dict[str, Any] | None
    delivery: Delivery | None = None
    picture_age: AgeSummary | None = None

    def line(self) -> str:
        """Returns the summary for people."""
        if self.pictures == 0:
            return joined("no frame", _recording_text(self.recording))
        return joined(
            plural(self.pictures, "frame"),
            f"{self.width_px}x{self.height_px} {self.codec} by {self.decoder}",
            f"first after {self.first_picture_ms} ms",
            f"{self.fps:.1f} fps" if self.fps else "",
            f"{self.corrupt_pictures} corrupt" if self.corrupt_pictures else "",
            delivery_text(self.delivery),
            _age_text(self.picture_age),
            f"reconnected {self.redials}x" if self.redials else "",
            _recording_text(self.recording),
        )


class FrameCounter:
    """Counts frames for a summary. Thread-safe; `count` is a frame listener of a session."""

    def __init__(self) -> None:
        self._started_s = time.monotonic()
        self._first_s = self._last_s = 0.0
        self._latest: Frame | None = None
        self._corrupt = 0
        self.frames = 0
        """Counted so far."""
        self.changed = threading.Condition()
        """Notified at every frame."""

    def count(self, frame: Frame) -> None:
        """Counts one frame."""
        with self.changed:
            self._first_s = self._first_s or frame.arrival_s
            self._last_s, self._latest = frame.arrival_s, frame
            self._corrupt += frame.corrupt
            self.frames += 1
            self.changed.notify_all()

    @property
    def last_s(self) -> float:
        """When the latest frame came, or counting began, on `time.monotonic()`."""
        return self._last_s or self._started_s

    def summary(
        self,
        redials: int,
        recording: Recording | None,
        delivery: Delivery | None = None,
        picture_age: AgeSummary | None = None,
    ) -> ViewSummary:
        """Returns the summary of all frames so far."""
        kept: dict[str, Any] | None = None
        if recording:
            kept = {"file": str(recording.file), "bytes": recording.size_bytes, "gaps": recording.gaps}
        with self.changed:
            frame, duration_s = self._latest, self._last_s - self._first_s
            if frame is None:
                return ViewSummary(
                    pictures=0, corrupt_pictures=0, redials=redials, recording=kept, delivery=delivery
                )
            return ViewSummary(
                pictures=self.frames,
                corrupt_pictures=self._corrupt,
                width_px=frame.width,
                height_px=frame.height,
                codec=frame.codec,
                decoder=frame.decoder,
                first_picture_ms=round((self._first_s - self._started_s) * _MS_PER_S),
                fps=round((self.frames - 1) / duration_s, 1) if duration_s > 0 else None,
                redials=redials,
                recording=kept,
                delivery=delivery,
                picture_age=picture_age,
            )


def _age_text(age: AgeSummary | None) -> str:
    return f"{age.median_ms:.0f} ms old, 95 % at most {age.p95_ms:.0f} ms" if age else ""


def _recording_text(recording: dict[str, Any] | None) -> str:
    if recording is None:
        return ""
    gaps = f" with {plural(recording['gaps'], 'gap')}: the disk was too slow" if recording["gaps"] else ""
    return f"{recording['file']}: {mebibytes(recording['bytes'])}{gaps}"
