"""SRT listener of a pipeline: reads the transport stream from a pipe and serves it to viewers.

    pipe ---> fdsrc ! srtsink

It is a pipeline of its own, so that it comes and goes, or fails, while the encoder goes on: a recording does
not notice viewers. framing.py has the other end of the pipe.
"""

import asyncio
import os
from collections.abc import Callable
from typing import Any, Final

from common.gst import Gst, stop
from preview.pipeline import faults
from preview.pipeline.events import Blame, Fault, HungError
from preview.pipeline.plan import Plan
from preview.pipeline.threads import in_thread
from preview.pipeline.viewer_limit import ViewerLimit

_LONGEST_READ: Final = 50 * 7 * 188
"""Bytes: a full pipe, in whole datagrams of seven packets."""
_SRT_POLL_MS: Final = 1000
"""Wake-up interval of the listener's thread; the default, no time-out, can block its stop forever."""


class Listener:
    """One listener from building to its end; created and used on the loop.

    Args:
        plan: of the pipeline; its passphrase is not None.
        on_failure: called once, on the event loop, with the first fault; not once it is being stopped.

    Attributes:
        pipeline: of the two elements.
        sink: the srtsink.
    """

    def __init__(self, plan: Plan, on_failure: Callable[[Fault], None]) -> None:
        self._plan = plan
        self._on_failure = on_failure
        self._loop = asyncio.get_running_loop()
        self._ended = False
        self._read_fd, self._write_fd = os.pipe()
        # A full pipe, left behind by a listener that has stopped, must not block a thread of Python.
        os.set_blocking(self._write_fd, False)
        self.pipeline = Gst.Pipeline.new("listener")
        self._source = Gst.ElementFactory.make("fdsrc", "pipe_out")
        self.sink = Gst.ElementFactory.make("srtsink", "sink")
        self._source.set_property("fd", self._read_fd)
        self._source.set_property("blocksize", _LONGEST_READ)
        _listen(self.sink, plan)
        self.pipeline.add(self._source)
        self.pipeline.add(self.sink)
        self._source.link(self.sink)
        self._limit = ViewerLimit(self.sink, plan.srt.max_viewers)
        self._bus = self.pipeline.get_bus()
        self._bus_fd = self._bus.get_pollfd().fd

    @property
    def sent_bytes(self) -> int:
        """Bytes of the transport stream so far."""
        return int(self._source.query_position(Gst.Format.BYTES).cur)

    def take_refused(self) -> int:
        """Returns how many viewers were refused since the last call."""
        return self._limit.take_refused()

    async def start(self, send_to: Callable[[int], None]) -> bool:
        """Binds the port and serves what is sent; False when that failed.

        Args:
            send_to: has the stream sent to this descriptor, a copy of which it keeps.
        """
        self._loop.add_reader(self._bus_fd, self._read_bus)
        deadline_s = self._plan.settings.timeouts.start_s
        pipeline = self.pipeline
        try:
            outcome = await in_thread(lambda: pipeline.set_state(Gst.State.PLAYING), deadline_s)
        except TimeoutError:
            self._fail(faults.of(Blame.LISTENER, f"has not started within {deadline_s:g} s", self._plan))
            return False
        self._read_bus()
        if outcome == Gst.StateChangeReturn.FAILURE:
            self._fail(faults.of(Blame.LISTENER, "could not be started and gave no reason", self._plan))
        if self._ended:
            return False
        send_to(self._write_fd)
        return True

    async def stop(self) -> Callable[[], None]:
        """Stops it, which frees the port and disconnects the viewers.

        Returns:
            Frees the rest; may block, and is called in a thread.

        Raises:
            HungError: it hangs.
        """
        self._ended = True
        self._loop.remove_reader(self._bus_fd)
        last = [self.pipeline]
        del self.pipeline, self._source, self.sink, self._bus, self._limit
        try:
            await in_thread(lambda: stop(last[0]), self._plan.settings.timeouts.stop_s)
        except TimeoutError as error:
            raise HungError("the SRT listener hung when it was stopped") from error
        for fd in (self._read_fd, self._write_fd):
            os.close(fd)
        # libsrt frees the port for good, and cleans up, when the last element is freed, and both take time.
        return last.clear

    def _read_bus(self) -> None:
        while not self._ended and (message := self._bus.pop_filtered(Gst.MessageType.ERROR)) is not None:
            self._fail(faults.of_listener(message, self._plan))

    def _fail(self, fault: Fault) -> None:
        if not self._ended:
            self._ended = True
            self._on_failure(fault)


def _listen(sink: Any, plan: Plan) -> None:
    srt = plan.srt
    # The URI first: setting it resets other properties.
    host = f"[{srt.bind}]" if ":" in srt.bind else srt.bind
    sink.set_property("uri", f"srt://{host}:{srt.port}?mode=listener")
    sink.set_property("latency", srt.latency_ms)
    for name, value in (
        ("wait-for-connection", False),
        ("sync", False),
        ("async", False),
        ("poll-timeout", _SRT_POLL_MS),
        ("enable-last-sample", False),
    ):
        sink.set_property(name, value)
    if plan.passphrase:
        Gst.util_set_object_arg(sink, "pbkeylen", str(srt.key_length_bytes))
        sink.set_property("passphrase", plan.passphrase)
