"""Which encoders this machine really has: each one is tried in a process of its own, once.

That an element exists says little: drivers refuse later, give nothing, give empty buffers, crash or hang. So
a candidate counts only after it really encoded frames. A crash or a hang of the trial is a result like any
other. Results are remembered for the life of this process.
"""

import asyncio
import json
import signal
import sys
from collections.abc import Iterable, Mapping
from typing import Final

from common.gst import Gst
from preview.encoders.catalogue import Encoder
from preview.encoders.selection import Verdict
from preview.values import Target

_MAX_ANSWER_BYTES: Final = 64 * 1024


class Prober:
    """Tries encoders, one at a time, and remembers.

    Args:
        target: what they are tried with.
        timeout_s: how long one trial may take, the start of its process included.
    """

    def __init__(self, target: Target, timeout_s: float) -> None:
        self._target = target
        self._timeout_s = timeout_s
        self._trials: dict[str, asyncio.Task[Verdict]] = {}
        self._one_at_a_time = asyncio.Lock()

    @property
    def verdicts(self) -> Mapping[str, Verdict]:
        """What is known so far, by name."""
        return {
            name: trial.result()
            for name, trial in self._trials.items()
            if trial.done() and not trial.cancelled() and trial.exception() is None
        }

    async def verdict(self, encoder: Encoder) -> Verdict:
        """What came of trying it; tries it when that was not done yet."""
        trial = self._trials.get(encoder.name)
        if trial is None:
            trial = asyncio.create_task(self._try(encoder), name=f"trial of {encoder.name}")
            self._trials[encoder.name] = trial
        # One who waits may give up; the trial goes on for the others.
        return await asyncio.shield(trial)

    async def try_all(self, encoders: Iterable[Encoder]) -> None:
        """Tries them in turn."""
        for encoder in encoders:
            await self.verdict(encoder)

    async def close(self) -> None:
        """Ends trials that still run."""
        for trial in self._trials.values():
            trial.cancel()
        await asyncio.gather(*self._trials.values(), return_exceptions=True)

    async def _try(self, encoder: Encoder) -> Verdict:
        if Gst.ElementFactory.find(encoder.element) is None:
            return Verdict(
                present=False, proven=False, reason=f"there is no GStreamer element {encoder.element}"
            )
        async with self._one_at_a_time:
            return await self._run_trial(encoder)

    async def _run_trial(self, encoder: Encoder) -> Verdict:
        figures = (self._target.width_px, self._target.height_px, self._target.fps, self._target.bitrate_kbps)
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "preview.encoders.probe_child", encoder.name),
            *(str(figure) for figure in figures),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_MAX_ANSWER_BYTES,
        )
        try:
            answer, _ = await asyncio.wait_for(process.communicate(), self._timeout_s)
        except TimeoutError:
            return _failed(f"it hung: no result within {self._timeout_s:g} s")
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        return _read(answer, process.returncode or 0)


def _read(answer: bytes, code: int) -> Verdict:
    if code < 0:
        return _failed(f"it crashed when tried ({signal.Signals(-code).name})")
    try:
        outcome = json.loads(answer)
        reason, first_byte_ms = str(outcome["reason"]), outcome["first_byte_ms"]
    except (ValueError, KeyError, TypeError):
        return _failed(f"its trial ended with code {code} and without a result")
    if reason:
        return _failed(" ".join(reason.split()))
    return Verdict(present=True, proven=True, first_byte_ms=float(first_byte_ms))


def _failed(reason: str) -> Verdict:
    return Verdict(present=True, proven=False, reason=reason)
