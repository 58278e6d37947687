"""Endless playback of a file without rebuilding the pipeline.

A probe drops the end of stream before it leaves the source; a flushing seek returns to the beginning, and a
pad offset continues the running time, so that downstream sees at most one late frame.
"""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.threads import call_on_loop, in_thread

_SEEK_DEADLINE_S: Final = 3.0


class FileLoop:
    """The probe on the last pad of a file source.

    Args:
        pipeline: the pipeline.
        source: a source in it that plays a file.
        on_failure: called on the event loop when the seek fails.
    """

    def __init__(self, pipeline: Any, source: Any, on_failure: Callable[[], None]) -> None:
        self._pipeline = pipeline
        self._source = source
        self._pad = source.get_by_name("pace").get_static_pad("sink")
        self._loop = asyncio.get_running_loop()
        self._on_failure = on_failure
        self._task: asyncio.Task[None] | None = None
        self._detached = False
        self._probe_id = self._pad.add_probe(
            Gst.PadProbeType.EVENT_DOWNSTREAM | Gst.PadProbeType.EVENT_FLUSH, self._probe
        )

    def detach(self) -> None:
        """Removes the probe: with it the pipeline and this object would keep each other alive."""
        self._detached = True
        self._pad.remove_probe(self._probe_id)
        if self._task:
            self._task.cancel()

    def _probe(self, _pad: Any, info: Any) -> Any:
        """Drops the end of stream and the flushes of the seek, on streaming threads."""
        kind = info.get_event().type
        if kind == Gst.EventType.EOS:
            call_on_loop(self._loop, self._restart)
        if kind in {Gst.EventType.EOS, Gst.EventType.FLUSH_START, Gst.EventType.FLUSH_STOP}:
            return Gst.PadProbeReturn.DROP
        return Gst.PadProbeReturn.OK

    def _restart(self) -> None:
        if self._detached:
            return
        self._task = asyncio.create_task(self._seek(), name="loop the file")

    async def _seek(self) -> None:
        clock = self._pipeline.get_clock()
        if clock is None:
            return  # Stopped in the meantime.
        # The last frame was due just now: the next one is due now, in the source's running time.
        self._pad.set_offset(clock.get_time() - self._source.get_base_time())
        to_start = Gst.Event.new_seek(
            1.0, Gst.Format.TIME, Gst.SeekFlags.FLUSH, Gst.SeekType.SET, 0, Gst.SeekType.NONE, -1
        )
        try:
            done = await in_thread(lambda: self._pad.push_event(to_start), _SEEK_DEADLINE_S)
        except TimeoutError:
            done = False
        if not done:
            self._on_failure()
