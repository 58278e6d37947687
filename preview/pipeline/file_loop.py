"""Plays a file again and again without rebuilding anything.

The end of the file is caught before it leaves the source; a seek brings the file back to its beginning, and
an offset lets its time go on from where it ended, so nothing downstream notices more than one late picture.
"""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.threads import Crossing, in_thread

_SEEK_DEADLINE_S: Final = 3.0


class Looping:
    """The probe on the last pad of a file source.

    Args:
        parts: the pipeline.
        crossing: the way to the loop.
        on_failure: called on the loop when the file can't be begun again.
    """

    def __init__(self, parts: Parts, crossing: Crossing, on_failure: Callable[[], None]) -> None:
        self._pipeline = parts.pipeline
        self._pad = parts.source.get_by_name("pace").get_static_pad("sink")
        self._crossing = crossing
        self._on_failure = on_failure
        self._task: asyncio.Task[None] | None = None
        self._probe_id = self._pad.add_probe(
            Gst.PadProbeType.EVENT_DOWNSTREAM | Gst.PadProbeType.EVENT_FLUSH, self._probe
        )

    def detach(self) -> None:
        """Takes the probe away: through it the pipeline and this object would keep each other alive."""
        self._pad.remove_probe(self._probe_id)
        if self._task:
            self._task.cancel()

    def _probe(self, _pad: Any, info: Any) -> Any:
        """On streaming threads: keeps the end, and the flushing that the seek causes, from going on."""
        kind = info.get_event().type
        if kind == Gst.EventType.EOS:
            self._crossing.hand_over(self._begin_again)
        if kind in {Gst.EventType.EOS, Gst.EventType.FLUSH_START, Gst.EventType.FLUSH_STOP}:
            return Gst.PadProbeReturn.DROP
        return Gst.PadProbeReturn.OK

    def _begin_again(self) -> None:
        self._task = asyncio.create_task(self._seek(), name="loop the file")

    async def _seek(self) -> None:
        clock = self._pipeline.get_clock()
        if clock is None:
            return  # Stopped meanwhile.
        # The last picture was shown just now: the next one is due now, on the pipeline's time.
        self._pad.set_offset(clock.get_time() - self._pipeline.get_base_time())
        try:
            done = await in_thread(lambda: self._pad.push_event(_to_the_beginning()), _SEEK_DEADLINE_S)
        except TimeoutError:
            done = False
        if not done:
            self._on_failure()


def _to_the_beginning() -> Any:
    return Gst.Event.new_seek(
        1.0, Gst.Format.TIME, Gst.SeekFlags.FLUSH, Gst.SeekType.SET, 0, Gst.SeekType.NONE, -1
    )
