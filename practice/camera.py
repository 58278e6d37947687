"""The practice robot's camera and its stream: pictures that arrive as late as the network has them."""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from practice.network import Network
from practice.scene import Stroke, View, seen

WIDTH_PX: Final = 640
HEIGHT_PX: Final = 360
_PERIOD_S: Final = 0.05
_MOST_ON_THEIR_WAY: Final = 64
"""Pictures: three seconds of them."""
_ENDS_WITHIN_S: Final = 1.0

Paint: TypeAlias = Callable[[Sequence[Stroke], int, int], bytes]
"""Paints strokes on a picture of this width and height, in BGRx; called in the camera's thread."""


class CameraStream:
    """A connection to the stream, in a thread of its own, until it is closed.

    Args:
        queue: takes the pictures.
        look: returns where the camera is.
        captured: takes when a picture was captured, in ns of CLOCK_MONOTONIC.
        network: returns what is between camera and screen now.
        paint: paints.
    """

    def __init__(
        self,
        queue: FrameQueue,
        look: Callable[[], View],
        captured: Callable[[int], None],
        network: Callable[[], Network],
        paint: Paint,
    ) -> None:
        self.delivery = Delivery(kind=DeliveryChoice.DIRECT)
        """As over a network that loses nothing."""
        self.received_s: float | None = None
        """Unknown: each frame is shown as soon as it comes."""
        self._queue = queue
        self._look, self._captured, self._network, self._paint = look, captured, network, paint
        self._on_their_way: deque[tuple[float, Frame]] = deque(maxlen=_MOST_ON_THEIR_WAY)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="practice-camera", daemon=True)
        self._thread.start()

    def close(self) -> bool:
        """Ends the stream; afterwards nothing reaches the queue. Returns whether it ended in time."""
        self._closed.set()
        self._thread.join(_ENDS_WITHIN_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._closed.wait(_PERIOD_S):
            network, now_s = self._network(), time.monotonic()
            if network.camera:
                self._capture(network, now_s)
            while self._on_their_way and self._on_their_way[0][0] <= now_s:
                self._queue.put(self._on_their_way.popleft()[1])

    def _capture(self, network: Network, now_s: float) -> None:
        captured_ns = int(now_s * 1e9)
        self._captured(captured_ns)
        arrives_s = network.picture_arrives_s(now_s)
        if arrives_s is None:
            return
        pixels = self._paint(seen(self._look(), WIDTH_PX, HEIGHT_PX), WIDTH_PX, HEIGHT_PX)
        frame = Frame(
            width=WIDTH_PX,
            height=HEIGHT_PX,
            codec="none",
            pts_ns=None,
            arrival_s=arrives_s,
            corrupt=False,
            stride=4 * WIDTH_PX,
            read=lambda: pixels,
            capture_ns=captured_ns,
            received_s=arrives_s,
        )
        self._on_their_way.append((arrives_s, frame))
