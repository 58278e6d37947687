"""Sends each picture whole: a transport stream cut at the picture's end, not seven packets at a time.

A muxer that groups packets by seven keeps the tail of every picture until the next one fills the group. Here
it hands out all packets of a picture as one list, and this probe on its source pad joins them to one buffer.
The listener cuts that into datagrams of seven packets itself, the last one ending where the picture ends.

The buffer gets none of the packets' flags: the muxer flags everything that starts with its tables as HEADER,
and a srtsink that got tables with the caps drops such buffers whole.

This is the only Python that runs with every picture, and every call into GStreamer costs microseconds, so it
makes as few as it can. It also is where pictures are counted.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.clock_references import ClockReferences

# More than any packet has: asking each of the fifty for its size first would cost a third more.
_ALL: Final = 1 << 16


class Framing:
    """The probe and what it counted. The counters are written by whoever sends and read anywhere.

    Args:
        on_first_picture: called once, on the streaming thread: it must only hand over.
        rate_fps: of the pictures.
    """

    def __init__(self, on_first_picture: Callable[[], None], rate_fps: float) -> None:
        self.pictures = 0
        self.bytes = 0
        self.last_picture_at = 0.0
        """time.monotonic() of the newest picture."""
        self._on_first_picture = on_first_picture
        self._way_out: Any = None
        """The listener's pad; None again once it is given up, while the encoder may still be at it."""
        self._references = ClockReferences(self._send_reference, rate_fps)
        self._detach: Callable[[], None] | None = None

    def attach(self, muxer_pad: Any) -> None:
        """Puts the probe on the muxer's source pad, which is linked to the listener."""
        self._way_out = muxer_pad.get_peer()
        probe = muxer_pad.add_probe(Gst.PadProbeType.BUFFER_LIST | Gst.PadProbeType.BUFFER, self._probe)
        self._detach = partial(muxer_pad.remove_probe, probe)

    def detach(self) -> None:
        """Takes the probe away: through it the pipeline and this object would keep each other alive."""
        if self._detach:
            self._detach()
        self._detach = None
        self._references.stop()
        self._way_out = None

    def set_rate(self, rate_fps: float) -> None:
        """Another rate of pictures. May wait until one is sent."""
        self._references.set_rate(rate_fps)

    def _probe(self, _pad: Any, info: Any) -> Any:
        if info.type & Gst.PadProbeType.BUFFER_LIST:
            packets = info.get_buffer_list()
            parts = [packets.get(index) for index in range(packets.length())]
        else:
            parts = [info.get_buffer()]
        if parts and (way_out := self._way_out):
            self._send_picture(parts, way_out)
        return Gst.PadProbeReturn.DROP

    def _send_picture(self, parts: list[Any], way_out: Any) -> None:
        joined = b"".join(part.extract_dup(0, _ALL) for part in parts)
        picture = Gst.Buffer.new_wrapped(joined)

        def send() -> None:
            way_out.chain(picture)
            self.bytes += len(joined)

        self._references.around(joined, send)
        self._count()

    def _send_reference(self, packet: bytes) -> None:
        """On the clock references' thread. The listener takes what comes from one thread at a time."""
        self._way_out.chain(Gst.Buffer.new_wrapped(packet))
        self.bytes += len(packet)

    def _count(self) -> None:
        self.last_picture_at = time.monotonic()
        self.pictures += 1
        if self.pictures == 1:
            self._on_first_picture()
