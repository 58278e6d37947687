"""End of a source's stream, kept from the rest of the pipeline: another camera may take the source's place.

An end that passed the encoder and the muxer would be theirs as well. The probe sees events only, so no Python
runs for a frame.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from common.gst import Gst
from preview.pipeline.threads import call_on_loop


class SourceEnd:
    """The probe on the last pad of a source.

    Args:
        source: the bin.
        on_end: called on the event loop when the source has ended.
    """

    def __init__(self, source: Any, on_end: Callable[[], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._on_end: Callable[[], None] | None = on_end
        self._pad = source.get_static_pad("src")
        self._probe_id = self._pad.add_probe(Gst.PadProbeType.EVENT_DOWNSTREAM, self._probe)

    def detach(self) -> None:
        """Removes the probe: with it the source and this object would keep each other alive."""
        self._pad.remove_probe(self._probe_id)
        # An end that is on its way to the loop is that of a source which has been replaced by then.
        self._on_end = None

    def _probe(self, _pad: Any, info: Any) -> Any:
        if info.get_event().type != Gst.EventType.EOS:
            return Gst.PadProbeReturn.OK
        call_on_loop(self._loop, self._ended)
        return Gst.PadProbeReturn.DROP

    def _ended(self) -> None:
        if self._on_end:
            self._on_end()
