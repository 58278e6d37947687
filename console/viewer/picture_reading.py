"""Age of the picture on the screen, how exactly it is known, and what makes the picture old. Pure."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from console.client import PreviewStatus
from console.client.results import Freshness
from console.presentation.formatting import joined
from console.presentation.severity_style import SeverityStyle
from console.presentation.value_style import PICTURE_AGE_MS
from console.receiver.delivery import Delivery

OVERDUE_S: Final = 0.1
"""A picture that is shown for longer lacks a successor: frames come every 67 ms at the slowest profile."""
_MS_PER_S: Final = 1000


class AgeCause(Enum):
    """The part of the way from the camera to the screen that takes longest."""

    CAMERA = "camera"
    """The robot itself has no newer picture."""
    ENCODER = "encoder"
    """Pictures are old when they leave the robot."""
    LINK = "link"
    """Pictures are old, or missing, when they arrive."""
    DECODER = "decoder"
    """Pictures wait on this computer: decoder, or screen."""


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """One picture that was shown.

    Args:
        at_s: when, on `time.monotonic()`.
        age_ms: from capture to the screen.
        error_ms: bound of the error of that, as it follows from Ping.
        own_ms: the part of it on this computer: from the arrival of its last packet; None if unknown.
        capture_ns: when the camera took it, on the robot's monotonic clock.
    """

    at_s: float
    age_ms: float
    error_ms: float
    own_ms: float | None
    capture_ns: int

    @property
    def link_ms(self) -> float:
        """`age_ms` as far as the link may have caused it."""
        return max(0.0, self.age_ms - (self.own_ms or 0.0))


@dataclass(frozen=True, slots=True)
class Freeze:
    """A picture that has left the screen later than OVERDUE_S after it was shown.

    Args:
        picture: which.
        until_s: when the next one was shown, or none any more, on `time.monotonic()`.
        age_ms: of the picture at that moment.
    """

    picture: ShownPicture
    until_s: float
    age_ms: float

    def age_at_ms(self, at_s: float) -> float:
        """Returns the age of the picture at a moment of the freeze, in ms."""
        if at_s >= self.until_s:
            return self.age_ms
        return self.picture.age_ms + (at_s - self.picture.at_s) * _MS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureReading:
    """Figures of the picture on the screen; each is None while it is unknown.

    Args:
        age_ms: from capture to the screen; as long as no newer picture comes in time, from capture to now.
        error_ms: bound of the error of `age_ms`.
        cause: what takes longest; None for a picture that is young enough.
        rtt_ms: round trip of the stream's connection.
        loss_percent: share of its packets that were missing at first, in the last second.
    """

    age_ms: float | None = None
    error_ms: float | None = None
    cause: AgeCause | None = None
    rtt_ms: float | None = None
    loss_percent: float | None = None

    @property
    def style(self) -> SeverityStyle:
        """Severity of the age."""
        if self.age_ms is None:
            return SeverityStyle.QUIET
        return PICTURE_AGE_MS.judge(self.age_ms).style

    @property
    def age_text(self) -> str:
        """The age for people: 18 ms ± 1; with the cause where it is old; empty while it is unknown."""
        if self.age_ms is None:
            return ""
        cause = f" - {self.cause.value}" if self.cause else ""
        return f"{self.age_ms:.0f} ms \u00b1 {math.ceil(self.error_ms or 0)}{cause}"

    @property
    def link_text(self) -> str:
        """The link for people: round trip 20 ms, loss 0.3 %; empty while it is unknown."""
        return joined(
            f"round trip {self.rtt_ms:.0f} ms" if self.rtt_ms is not None else "",
            f"loss {self.loss_percent:.1f} %" if self.loss_percent is not None else "",
        )


def reading(
    shown: ShownPicture | None,
    delivery: Delivery | None,
    preview: PreviewStatus | None,
    now_s: float,
    received_s: float | None = None,
) -> PictureReading:
    """Returns the reading at one moment.

    Args:
        shown: the latest picture; None when none is on the screen, or its age is not known.
        delivery: how its packets come.
        preview: the robot's latest status.
        now_s: on `time.monotonic()`.
        received_s: when the newest picture was received, decoded or not; None if unknown.
    """
    rtt_ms = delivery.rtt_ms if delivery else None
    loss_percent = delivery.loss_percent if delivery else None
    if shown is None:
        return PictureReading(rtt_ms=rtt_ms, loss_percent=loss_percent)
    age_ms, cause = age_now_ms(shown, now_s), None
    if age_ms >= PICTURE_AGE_MS.warning:
        overdue = now_s - shown.at_s > OVERDUE_S
        cause = _missing_at(preview, received_s, now_s) if overdue else _slowest(shown, preview)
    return PictureReading(
        age_ms=age_ms, error_ms=shown.error_ms, cause=cause, rtt_ms=rtt_ms, loss_percent=loss_percent
    )


def age_now_ms(shown: ShownPicture, now_s: float) -> float:
    """Returns the age of a picture that is on the screen since `shown.at_s`, in ms."""
    since_s = now_s - shown.at_s
    return shown.age_ms + (since_s * _MS_PER_S if since_s > OVERDUE_S else 0.0)


def link_age_ms(shown: ShownPicture, now_s: float, received_s: float | None) -> float:
    """Returns the age now as far as the link may have caused it, in ms: without waiting on this computer.

    Args:
        shown: the picture on the screen.
        now_s: on `time.monotonic()`.
        received_s: when the newest picture was received, decoded or not; None if unknown.
    """
    silent_s = now_s - max(shown.at_s, received_s or 0.0)
    missing_ms = silent_s * _MS_PER_S if silent_s > OVERDUE_S else 0.0
    return shown.link_ms + missing_ms


def _missing_at(preview: PreviewStatus | None, received_s: float | None, now_s: float) -> AgeCause:
    """Returns where the next picture is missing."""
    if received_s is not None and now_s - received_s <= OVERDUE_S:
        return AgeCause.DECODER
    waited_ms = _newest_on_robot_ms(preview)
    frozen = waited_ms is not None and waited_ms > OVERDUE_S * _MS_PER_S
    return AgeCause.CAMERA if frozen else AgeCause.LINK


def _slowest(shown: ShownPicture, preview: PreviewStatus | None) -> AgeCause:
    """Returns the part of the way on which a picture took longest."""
    own_ms = shown.own_ms or 0.0
    # The figure was taken at any moment between two frames: an interval of them is no delay.
    newest_ms, fps = _newest_on_robot_ms(preview), preview.video.fps if preview and preview.video else 0.0
    interval_ms = _MS_PER_S / fps if fps > 0 else 0.0
    robot_ms = max(0.0, newest_ms - interval_ms) if newest_ms is not None else 0.0
    parts_ms = {
        AgeCause.LINK: shown.age_ms - own_ms - robot_ms,
        AgeCause.ENCODER: robot_ms,
        AgeCause.DECODER: own_ms,
    }
    return max(parts_ms, key=parts_ms.__getitem__)


def _newest_on_robot_ms(preview: PreviewStatus | None) -> float | None:
    """Returns the age of the newest encoded frame when the robot's figures were taken; None if unknown."""
    if preview is None or preview.measured.freshness is not Freshness.FRESH:
        return None
    newest_ms = preview.measured.last_frame_age_ms
    return None if newest_ms is None else max(0.0, newest_ms - (preview.measured.age_ms or 0))
