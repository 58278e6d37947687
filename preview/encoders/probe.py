"""Trials of encoders: which ones really encode on this machine.

The existence of an element proves little: drivers refuse later, return nothing, return empty buffers, crash
or hang. So an encoder counts as proven only after it has encoded frames, in a process of its own with a
deadline; a crash or a hang is a result like any other. Results are cached for the life of this process.
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

_MAX_OUTPUT_BYTES: Final = 64 * 1024


class TrialProber:
    """Runs trials, one at a time, and caches their results.

    Args:
        target: stream parameters of the trials.
        timeout_s: deadline of one trial, start of its process included.
    """

    def __init__(self, target: Target, timeout_s: float) -> None:
        self._target = target
        self._timeout_s = timeout_s
        self._trials: dict[str, asyncio.Task[Verdict]] = {}
        self._one_at_a_time = asyncio.Lock()

    @property
    def verdicts(self) -> Mapping[str, Verdict]:
        """Results so far, by encoder name."""
        return {
            name: trial.result()
            for name, trial in self._trials.items()
            if trial.done() and not trial.cancelled() and trial.exception() is None
        }

    async def verdict(self, encoder: Encoder) -> Verdict:
        """Returns the result for one encoder; runs its trial when there is none."""
        trial = self._trials.get(encoder.name)
        if trial is None:
            trial = asyncio.create_task(self._try(encoder), name=f"trial of {encoder.name}")
            self._trials[encoder.name] = trial
        # A cancelled caller does not cancel the trial: others may wait for it, too.
        return await asyncio.shield(trial)

    async def try_all(self, encoders: Iterable[Encoder]) -> None:
        """Runs the trials of these encoders, in order."""
        for encoder in encoders:
            await self.verdict(encoder)

    async def close(self) -> None:
        """Cancels running trials and waits for their processes."""
        for trial in self._trials.values():
            trial.cancel()
        await asyncio.gather(*self._trials.values(), return_exceptions=True)

    async def _try(self, encoder: Encoder) -> Verdict:
        if Gst.ElementFactory.find(encoder.element) is None:
            reason = f"there is no GStreamer element {encoder.element}"
            return Verdict(present=False, proven=False, reason=reason)
        async with self._one_at_a_time:
            return await self._run_trial(encoder)

    async def _run_trial(self, encoder: Encoder) -> Verdict:
        target = self._target
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "preview.encoders.probe_child", encoder.name),
            *map(str, (target.width_px, target.height_px, target.fps, target.bitrate_kbps)),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_MAX_OUTPUT_BYTES,
        )
        try:
            output, _ = await asyncio.wait_for(process.communicate(), self._timeout_s)
        except TimeoutError:
            return _failed(f"it hung: no result within {self._timeout_s:g} s")
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        return _parse(output, process.returncode or 0)


def _parse(output: bytes, code: int) -> Verdict:
    if code < 0:
        return _failed(f"it crashed when tried ({signal.Signals(-code).name})")
    try:
        outcome = json.loads(output)
        reason, first_byte_ms = str(outcome["reason"]), outcome["first_byte_ms"]
    except (ValueError, KeyError, TypeError):
        return _failed(f"its trial ended with code {code} and without a result")
    if reason:
        return _failed(" ".join(reason.split()))
    return Verdict(present=True, proven=True, first_byte_ms=float(first_byte_ms))


def _failed(reason: str) -> Verdict:
    return Verdict(present=True, proven=False, reason=reason)
