"""Calls into the driver of a running encoder, which may block there for any time."""

import asyncio
import logging
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Final

from common.tasks import end
from common.units import bit_rate
from preview.encoders import properties
from preview.pipeline import faults
from preview.pipeline.adaptive import Decision
from preview.pipeline.events import Blame, Fault
from preview.pipeline.running import Running
from preview.pipeline.threads import in_thread

_log = logging.getLogger(__name__)

_DEADLINE_S: Final = 2.0


class EncoderDriver:
    """Makes the calls in a thread of their own: one at a time, each with a deadline, none after the end.

    Args:
        running: the pipeline.
        bitrate: what its encoder is set to.
        fail: called with the fault when a call hangs.

    Attributes:
        bitrate: what the encoder is set to, and why.
        lock: held by a call, and by what must not happen during one.
    """

    def __init__(self, running: Running, bitrate: Decision, fail: Callable[[Fault], None]) -> None:
        self._running = running
        self._fail = fail
        self._tasks: dict[str, asyncio.Task[None]] = {}
        """The newest of each kind."""
        self.bitrate = bitrate
        self.lock = asyncio.Lock()

    @property
    def sets_bitrate(self) -> bool:
        """Whether the encoder has yet to apply a bit rate."""
        return self._is_pending("bit rate")

    def request_key_frame(self) -> None:
        """Requests a key frame for a new viewer; one that is already requested serves both."""
        if self._running.has_ended or self._is_pending("key frame"):
            return
        parts, encoder = self._running.parts, self._running.plan.encoder
        muxed_pad = parts.pipe_in.get_static_pad("sink")
        work = partial(properties.request_key_frame, parts.encoder, encoder, muxed_pad)
        self._spawn("key frame", self.call(work, "it was asked for a key frame"))

    def set_bitrate(self, decision: Decision) -> None:
        """Sets another bit rate, unless another profile is set before its turn comes."""
        if decision.bitrate_kbps == self.bitrate.bitrate_kbps:
            self.bitrate = decision
        else:
            self._spawn("bit rate", self._set_bitrate(decision))

    async def call(self, work: Callable[[], None], when: str) -> None:
        """Makes a call.

        Args:
            work: what may block.
            when: what is being done, as a clause: "it was asked for a key frame".
        """
        async with self.lock:
            if self._running.has_ended:
                return
            calling = asyncio.create_task(in_thread(work, _DEADLINE_S), name=f"encoder: {when}")
            try:
                # Does not delay the reaction to another failure in the meantime.
                await asyncio.wait((calling, self._running.ended), return_when=asyncio.FIRST_COMPLETED)
                if calling.done():
                    calling.result()
            except TimeoutError:
                self._fail(faults.of(Blame.ENCODER, f"hung when {when}", self._running.plan))
            finally:
                calling.cancel()

    async def close(self) -> None:
        """Waits for no call any more."""
        await end(self._tasks.values())

    async def _set_bitrate(self, decision: Decision) -> None:
        _log.info("bit rate: %s", decision.reason or bit_rate(decision.bitrate_kbps))
        running = self._running
        encoder, plan = running.parts.encoder, running.plan

        def apply() -> None:
            if (
                plan is running.plan
            ):  # Otherwise another profile was set in the meantime: its bit rate applies.
                properties.set_bitrate(encoder, plan.encoder, decision.bitrate_kbps, plan.gop_frames)

        await self.call(apply, "its bit rate was changed")
        if plan is running.plan:
            self.bitrate = decision

    def _is_pending(self, name: str) -> bool:
        return name in self._tasks and not self._tasks[name].done()

    def _spawn(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        self._tasks[name] = asyncio.create_task(work, name=name)
