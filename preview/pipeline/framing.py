"""Frame-aligned transport stream: sends each access unit whole, without waiting for the next one.

A muxer that groups packets by seven (mpegtsmux alignment=7) holds back the tail of every frame until the next
one fills the group. Without groups (alignment=0) it pushes all packets of a frame as one buffer list, and
srtsink would send each of them as a datagram of its own. So the frame passes through a pipe:

    muxer ! fdsink ---> pipe ---> fdsrc ! listener (listener.py)

fdsink writes the list with one call of writev, and fdsrc reads it as one buffer. The listener cuts that into
datagrams of seven packets (7 x 188 = 1316 bytes, SRTO_PAYLOADSIZE of live mode); the last one ends where the
frame ends. A frame larger than the pipe passes in parts, which cost no time either. Joining the packets in
Python takes a twentieth of the CPU time that x264 needs for the frame.

The pipe passes nothing but bytes: neither the flag HEADER, which the muxer sets on each run that starts with
its tables (PAT, PMT), nor its stream headers; srtsink drops buffers with the one if it got the others. They
would also reach every new viewer, with continuity counters that the stream does not continue; its key frame
brings tables anyway.

Without a listener the frames go to the null device: the elements and what they count stay as they are.
No Python runs for a frame but the first, except at frame rates that need clock references: the
elements count.
"""

import asyncio
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.capture_clock import captured_ns
from preview.pipeline.clock_references import HEAD_PACKETS, ClockReferences
from preview.pipeline.threads import call_on_loop


class Framing:
    """The pipe, and what has passed it.

    Args:
        parts: the pipeline, not yet started.
        on_first_frame: called once, on the event loop, with the first frame.
        on_end: called on the event loop when the stream has ended. The pipeline does not report that: the end
            does not pass the pipe.
        fps: frame rate.
    """

    def __init__(
        self, parts: Parts, on_first_frame: Callable[[], None], on_end: Callable[[], None], fps: float
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._on_first_frame = on_first_frame
        self._on_end = on_end
        self._write_fd = os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC)
        self._pipe_in = parts.pipe_in
        self._pipe_in.set_property("fd", self._write_fd)
        self._begun = False
        self._first_captured_ns: int | None = None
        """Capture time of the first frame, from which the muxer counts the times of its buffers."""
        parts.parser_pad.get_peer().add_probe(Gst.PadProbeType.BUFFER, self._on_first_unit)
        self._references = ClockReferences(self._send_reference, lambda: self.frames, fps)
        self._muxer_pad = parts.muxer_pad
        self._lock = threading.Lock()
        """Held by threads that add or remove the probe: doing so and keeping its number is one step."""
        self._frame_probe: int | None = None
        self._event_probe = self._muxer_pad.add_probe(Gst.PadProbeType.EVENT_DOWNSTREAM, self._on_event)
        self._watch_frames()

    def detach(self) -> None:
        """Removes the probes: with them the pipeline and this object would keep each other alive."""
        with self._lock:
            self._muxer_pad.remove_probe(self._event_probe)
            if self._frame_probe is not None:
                self._muxer_pad.remove_probe(self._frame_probe)
            self._references.stop()
            del self._muxer_pad, self._pipe_in

    def close(self) -> None:
        """Closes the pipe; to be called once the pipeline has stopped, which could write to another file."""
        os.close(self._write_fd)

    def send_to(self, fd: int) -> None:
        """Sends the frames from now on to another file, of which a copy is kept."""
        # One step for whatever writes at this moment: the number stays, the file is another one (dup2(2)).
        os.dup2(fd, self._write_fd, inheritable=False)

    def discard(self) -> None:
        """Discards the frames from now on."""
        null = os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC)
        self.send_to(null)
        os.close(null)

    @property
    def frames(self) -> int:
        """Encoded frames so far."""
        return int(self._pipe_in.get_property("stats").get_value("rendered"))

    @property
    def last_frame_age_ms(self) -> float:
        """Milliseconds since the capture of the newest encoded frame; 0 before the first."""
        newest = self._pipe_in.get_property("last-sample")
        clock = self._pipe_in.get_clock()
        if newest is None or clock is None or self._first_captured_ns is None:
            return 0.0
        # The first one of the frame's list, which the sink sets a moment after it.
        captured_at = self._first_captured_ns + newest.get_buffer().pts
        age_ms: float = (clock.get_time() - captured_at) / Gst.MSECOND
        return max(0.0, age_ms)

    def set_rate(self, fps: float) -> None:
        """Sets another frame rate."""
        self._references.set_rate(fps)
        if self._references.wanted:
            self._watch_frames()

    def _watch_frames(self) -> None:
        with self._lock:
            if self._frame_probe is None:
                self._frame_probe = self._muxer_pad.add_probe(Gst.PadProbeType.BUFFER_LIST, self._on_frame)

    def _on_first_unit(self, pad: Any, info: Any) -> Any:
        self._first_captured_ns = captured_ns(info.get_buffer(), pad)
        return Gst.PadProbeReturn.REMOVE

    def _on_frame(self, _pad: Any, info: Any) -> Any:
        if not self._begun:
            self._begun = True
            call_on_loop(self._loop, self._on_first_frame)
        with self._lock:
            if not self._references.wanted:
                self._frame_probe = None
                return Gst.PadProbeReturn.REMOVE
        self._references.follow(_head_and_last(info.get_buffer_list()))
        return Gst.PadProbeReturn.OK

    def _on_event(self, _pad: Any, info: Any) -> Any:
        if info.get_event().type == Gst.EventType.EOS:
            call_on_loop(self._loop, self._on_end)
        return Gst.PadProbeReturn.OK

    def _send_reference(self, packet: bytes) -> None:
        """Sends a clock reference, on the thread and under the lock of ClockReferences."""
        with suppress(BlockingIOError):  # The listener has stopped.
            os.write(self._write_fd, packet)


def _head_and_last(packets: Any) -> bytes:
    """Returns the packets of a frame that clock_references.read needs."""
    count = packets.length()
    wanted = [packets.get(index) for index in (*range(min(count, HEAD_PACKETS)), count - 1)]
    return b"".join(packet.extract_dup(0, packet.get_size()) for packet in wanted)
