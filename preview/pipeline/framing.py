"""Frame-aligned transport stream: sends each access unit whole, without waiting for the next one.

A muxer that groups packets by seven (mpegtsmux alignment=7) holds back the tail of every frame until the next
one fills the group. Here the muxer pushes all packets of a frame as one buffer list (alignment=0), and this
probe on its source pad joins them into one buffer. The listener cuts that into datagrams of seven packets (7
x 188 = 1316 bytes, SRTO_PAYLOADSIZE of live mode); the last one ends where the frame ends.

The buffer inherits none of the packets' flags: the muxer flags each run that starts with its tables (PAT,
PMT) as HEADER, and a srtsink that got stream headers in its caps drops such buffers.

This is the only Python that runs for every frame, and every call into GStreamer costs microseconds, so it
makes as few as possible. It also counts the frames.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.clock_references import ClockReferences
from preview.pipeline.threads import call_on_loop

# Larger than any packet: asking each of some fifty packets for its size would add a third to the cost.
_ALL: Final = 1 << 16


class Framing:
    """The probe and its counters, which streaming threads write and any thread may read.

    Args:
        parts: the pipeline.
        on_first_frame: called once, on the event loop, after the first frame.
        fps: frame rate.
    """

    def __init__(self, parts: Parts, on_first_frame: Callable[[], None], fps: float) -> None:
        self.frames = 0
        self.bytes = 0
        self.last_frame_at = 0.0
        """time.monotonic() of the newest frame."""
        self._loop = asyncio.get_running_loop()
        self._on_first_frame = on_first_frame
        self._references = ClockReferences(self._send_reference, fps)
        self._muxer_pad = parts.muxer_pad
        self._listener_pad: Any = parts.muxer_pad.get_peer()
        """None once detached, while the encoder may still deliver."""
        self._probe_id = self._muxer_pad.add_probe(
            Gst.PadProbeType.BUFFER_LIST | Gst.PadProbeType.BUFFER, self._probe
        )

    def detach(self) -> None:
        """Removes the probe: with it the pipeline and this object would keep each other alive."""
        self._muxer_pad.remove_probe(self._probe_id)
        self._references.stop()
        del self._muxer_pad
        self._listener_pad = None

    def set_rate(self, fps: float) -> None:
        """Sets another frame rate. May block while a frame is being sent."""
        self._references.set_rate(fps)

    def _probe(self, _pad: Any, info: Any) -> Any:
        if info.type & Gst.PadProbeType.BUFFER_LIST:
            packets = info.get_buffer_list()
            buffers = [packets.get(index) for index in range(packets.length())]
        else:
            buffers = [info.get_buffer()]
        if buffers and (listener_pad := self._listener_pad):
            self._send_frame(b"".join(buffer.extract_dup(0, _ALL) for buffer in buffers), listener_pad)
        return Gst.PadProbeReturn.DROP

    def _send_frame(self, packets: bytes, listener_pad: Any) -> None:
        frame = Gst.Buffer.new_wrapped(packets)

        def send() -> None:
            listener_pad.chain(frame)
            self.bytes += len(packets)

        self._references.around(packets, send)
        self.last_frame_at = time.monotonic()
        self.frames += 1
        if self.frames == 1:
            call_on_loop(self._loop, self._on_first_frame)

    def _send_reference(self, packet: bytes) -> None:
        """Sends a clock reference, on the thread and under the lock of ClockReferences."""
        self._listener_pad.chain(Gst.Buffer.new_wrapped(packet))
        self.bytes += len(packet)
