"""Measures the age of the pictures that a viewer shows."""

import secrets
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

from common.suspend import SuspendedTime
from console.client import Offset, PictureDelivery, PictureReport, PreviewStatus
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.frame import Frame
from console.viewer.picture_reading import (
    OVERDUE_S,
    AgeCause,
    Freeze,
    PictureReading,
    ShownPicture,
    age_now_ms,
    link_age_ms,
    reading,
)

_KEPT: Final = 3600
"""Pictures: a minute at 60 frames/s."""
_FREEZES_KEPT: Final = 600
"""A minute of them: each lasts for more than OVERDUE_S."""
HISTORY_SLOTS: Final = 120
SLOT_S: Final = 0.5
_LONGEST_MS: Final = 60_000
"""The robot takes no larger age or round trip."""
_PERCENTILES: Final = 20
_MS_PER_S: Final = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class AgeSummary:
    """Ages of the last pictures, at most 3600, from capture to the screen; without one, to the decoder.

    Args:
        median_ms: half of them were younger.
        p95_ms: 95 % of them were younger.
        worst_ms: the largest age of a picture on the screen, while the next one was overdue as well.
        last_ms: of the last picture, when it was shown.
        error_ms: bound of the error of all ages.
        cause: why the last picture was older than 150 ms; None if it was not.
    """

    median_ms: float
    p95_ms: float
    worst_ms: float
    last_ms: float
    error_ms: float
    cause: AgeCause | None


class PictureMeter:
    """Notes every picture when it is shown. Thread-safe; nothing here blocks.

    Args:
        clock_offset: returns the offset of the robot's clock; None while it is not known.
        delivery: returns how packets are delivered.
        preview: returns the robot's latest status; None before the first.
        received: returns when the newest picture was received; None if unknown.
    """

    def __init__(
        self,
        clock_offset: Callable[[], Offset | None],
        delivery: Callable[[], Delivery | None] = lambda: None,
        preview: Callable[[], PreviewStatus | None] = lambda: None,
        received: Callable[[], float | None] = lambda: None,
    ) -> None:
        self._clock_offset = clock_offset
        self._delivery = delivery
        self._preview = preview
        self._received = received
        self._viewer_id = secrets.token_hex(4)
        self._lock = threading.Lock()
        self._shown: deque[ShownPicture] = deque(maxlen=_KEPT)
        self._freezes: deque[Freeze] = deque(maxlen=_FREEZES_KEPT)
        """Those that have ended, in their order."""
        self._latest: ShownPicture | None = None
        """The picture on the screen; None while none is, or its age is unknown."""
        self._reported_s = 0.0
        self._suspended = SuspendedTime()
        """Since the latest picture was shown."""

    def robot_now_ns(self) -> int | None:
        """Returns the estimate of the robot's monotonic clock; None while there is none."""
        offset = self._clock_offset()
        return None if offset is None else round((time.monotonic() + offset.seconds) * 1e9)

    def shown(self, frame: Frame) -> None:
        """Notes that a frame has just been shown for the first time."""
        offset, now_s = self._clock_offset(), time.monotonic()
        if frame.capture_ns is None or offset is None:
            return
        age_ms = (now_s + offset.seconds) * _MS_PER_S - frame.capture_ns / 1e6
        if age_ms < -offset.error_s * _MS_PER_S:
            # From the future: the offset is of before one of the clocks stood still.
            self.forget()
            return
        own_ms = None if frame.received_s is None else (now_s - frame.received_s) * _MS_PER_S
        picture = ShownPicture(now_s, max(0.0, age_ms), offset.error_s * _MS_PER_S, own_ms, frame.capture_ns)
        with self._lock:
            self._end_latest(now_s)
            self._shown.append(picture)
            self._latest, self._suspended = picture, SuspendedTime()

    def forget(self) -> None:
        """Notes that no picture is on the screen any more; history and summary keep those that were."""
        with self._lock:
            self._end_latest(time.monotonic())
            self._latest = None

    def _end_latest(self, now_s: float) -> None:
        """Notes the freeze that the picture on the screen was, if it was one."""
        if freeze := self._present_freeze(now_s):
            self._freezes.append(freeze)

    def reading(self) -> PictureReading:
        """Returns the reading of this moment."""
        shown, now_s = self.latest(), self._now_s()
        return reading(shown, self._delivery(), self._preview(), now_s, self._received())

    def latest(self) -> ShownPicture | None:
        """Returns the latest picture of known age; None when none is on the screen."""
        with self._lock:
            return self._latest

    def capture_ns(self) -> int | None:
        """Returns when the picture on the screen was captured, on the robot's monotonic clock, in ns.

        It is what a driver's session reports of the picture (`DriveOptions.picture`). None without a picture
        of known age.
        """
        picture = self.latest()
        return picture.capture_ns if picture else None

    def history(self) -> list[float | None]:
        """Returns the largest age in each half second of the last minute, the newest last.

        None stands for half a second without a picture of known age.
        """
        oldest = int(time.monotonic() / SLOT_S) - HISTORY_SLOTS + 1
        worst: list[float | None] = [None] * HISTORY_SLOTS

        def note(slot: int, age_ms: float) -> None:
            if 0 <= slot < HISTORY_SLOTS:
                worst[slot] = max(worst[slot] or 0.0, age_ms)

        for picture in self._pictures():
            note(int(picture.at_s / SLOT_S) - oldest, picture.age_ms)
        for freeze in self._all_freezes():
            first, last = (int(at_s / SLOT_S) - oldest for at_s in (freeze.picture.at_s, freeze.until_s))
            for slot in range(max(first, 0), min(last, HISTORY_SLOTS - 1) + 1):
                note(slot, freeze.age_at_ms((oldest + slot + 1) * SLOT_S))
        return worst

    def worst_ms(self, within_s: float) -> float | None:
        """Returns the largest age of the last `within_s` seconds; None when no picture is on the screen."""
        if self.latest() is None:
            return None
        return self._worst_since_ms(time.monotonic() - within_s)

    def summary(self) -> AgeSummary | None:
        """Returns the ages of the last pictures; None without one of known age."""
        pictures = self._pictures()
        if not pictures:
            return None
        ages_ms = [picture.age_ms for picture in pictures]
        # Of one value there are no percentiles but itself.
        p95_ms = statistics.quantiles(ages_ms * 2, n=_PERCENTILES, method="inclusive")[-1]
        last = pictures[-1]
        return AgeSummary(
            median_ms=round(statistics.median(ages_ms), 1),
            p95_ms=round(p95_ms, 1),
            worst_ms=round(self._worst_since_ms(pictures[0].at_s), 1),
            last_ms=round(last.age_ms, 1),
            error_ms=round(max(picture.error_ms for picture in pictures), 2),
            cause=reading(last, self._delivery(), self._preview(), last.at_s).cause,
        )

    def report(self) -> PictureReport | None:
        """Returns the worst age since the last report; None when no picture of known age is on the screen."""
        now_s = time.monotonic()
        since_s, self._reported_s = self._reported_s, now_s
        latest = self.latest()
        if latest is None:
            return None
        age_ms = self._worst_since_ms(since_s)
        since = takewhile(lambda each: each.at_s > since_s, reversed(self._pictures()))
        of_link_ms = max([link_age_ms(latest, now_s, self._received()), *(each.link_ms for each in since)])
        delivery = self._delivery()
        rtt_ms = delivery.rtt_ms if delivery else None
        direct = delivery is not None and delivery.kind is DeliveryChoice.DIRECT
        return PictureReport(
            viewer_id=self._viewer_id,
            picture_age_ms=min(_LONGEST_MS, round(age_ms)),
            picture_age_error_ms=min(_LONGEST_MS, round(latest.error_ms)),
            rtt_ms=None if rtt_ms is None else min(_LONGEST_MS, round(rtt_ms)),
            loss_percent=delivery.loss_percent if delivery else None,
            packets_held=delivery.waited if delivery else 0,
            packets_given_up=delivery.given_up if delivery else 0,
            delivery=PictureDelivery.DIRECT if direct else PictureDelivery.SRT_LATENCY,
            link_age_ms=min(_LONGEST_MS, round(of_link_ms)),
        )

    def _now_s(self) -> float:
        """Returns the time by which the picture on the screen gets older: in a suspend, too."""
        return time.monotonic() + self._suspended.seconds()

    def _worst_since_ms(self, since_s: float) -> float:
        """Returns the largest age that a picture on the screen has had since then; 0 without one."""
        shown = takewhile(lambda each: each.at_s >= since_s, reversed(self._pictures()))
        late = takewhile(lambda each: each.until_s > since_s, reversed(self._all_freezes()))
        return max([0.0, *(each.age_ms for each in shown), *(each.age_ms for each in late)])

    def _all_freezes(self) -> tuple[Freeze, ...]:
        """Returns the freezes, with the present one if there is one."""
        with self._lock:
            freeze = self._present_freeze(time.monotonic())
            return (*self._freezes, freeze) if freeze else tuple(self._freezes)

    def _present_freeze(self, now_s: float) -> Freeze | None:
        """Returns the freeze that the picture on the screen is by now; None if it is none yet."""
        latest, until_s = self._latest, self._now_s()
        if latest is None or until_s - latest.at_s <= OVERDUE_S:
            return None
        return Freeze(latest, now_s, age_now_ms(latest, until_s))

    def _pictures(self) -> tuple[ShownPicture, ...]:
        with self._lock:
            return tuple(self._shown)
