"""When a frame was captured, on the monotonic clock: by its own stamp where that can be true. Pure.

| `header.stamp` | capture time |
|---|---|
| up to 10 s old | the stamp |
| up to 0.1 s ahead, as of a clock that is being slewed | now |
| 0, older, further ahead: no stamp, simulated time, another machine's clock | when the message arrived |
| the same as that of the frame before, or an earlier one | when the message arrived |
| later than that, but more than half a second before the capture time of the frame before | the same |

Time never runs backwards: a frame that would be captured before the one before it follows that by a tick.
"""

from typing import Final

from common.receive_time import Instant

OLDEST_NS: Final = 10_000_000_000
FURTHEST_AHEAD_NS: Final = 100_000_000
MOST_BEFORE_NS: Final = 500_000_000
_TICK_NS: Final = 100_000
_NS_PER_S: Final = 1_000_000_000


class CaptureTimes:
    """Of the frames of one topic, in their order.

    Attributes:
        replaced: frames whose stamp was not used.
    """

    def __init__(self) -> None:
        self.replaced = 0
        self._newest_ns = 0
        self._newest_stamp_ns = 0

    def of(self, stamp_ns: int, arrived_ns: int, now: Instant) -> int:
        """Returns the capture time of the next frame.

        Args:
            stamp_ns: its stamp, ns since 1970.
            arrived_ns: of its message, on the monotonic clock.
            now: the present instant.
        """
        age_ns = now.system_ns - stamp_ns
        captured_ns = int(now.monotonic_s * _NS_PER_S) - max(0, age_ns)
        plausible = (
            -FURTHEST_AHEAD_NS <= age_ns <= OLDEST_NS
            and stamp_ns > self._newest_stamp_ns
            and captured_ns > self._newest_ns - MOST_BEFORE_NS
        )
        if not plausible:
            self.replaced += 1
            captured_ns = arrived_ns
        self._newest_stamp_ns = stamp_ns
        self._newest_ns = max(captured_ns, self._newest_ns + _TICK_NS)
        return self._newest_ns
