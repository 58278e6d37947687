"""Decides what the next pipeline is made of: the source, the best encoder that works, the listener."""

import time
from collections.abc import Callable

from common.errors import UserError
from preview.config import PreviewSettings
from preview.encoders.probe import Prober
from preview.encoders.selection import Selection
from preview.pipeline import sources
from preview.pipeline.plan import ListenerPlan, Plan
from preview.values import Wish


class Planner:
    """Belongs to one event loop.

    Args:
        settings: the service's.
        prober: knows which encoders work.
        selection: knows which of them failed since.
        clock: seconds, monotonic.
    """

    def __init__(
        self,
        settings: PreviewSettings,
        prober: Prober,
        selection: Selection,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settings = settings
        self._prober = prober
        self._selection = selection
        self._clock = clock

    @property
    def wants_hardware(self) -> bool:
        """Whether this robot is meant to encode in hardware."""
        return self._selection.order[0].hardware

    @property
    def has_another(self) -> bool:
        """Whether an encoder is known that works and has not failed."""
        return self._selection.has_another(self._prober.verdicts)

    def pass_over(self, encoder: str, why: str) -> None:
        """This encoder failed while it was in use."""
        self._selection.pass_over(encoder, why, self._clock())

    async def try_encoders(self) -> None:
        """Waits until one is known that works and has not failed, or all are known."""
        for encoder in self._selection.order:
            await self._prober.verdict(encoder)
            if self.has_another:
                return

    def plan(self, wish: Wish) -> Plan:
        """What to build for this wish; after `try_encoders`.

        Raises:
            UserError: the source can't be used, or no encoder works.
        """
        verdicts = self._prober.verdicts
        found = self._selection.choose(verdicts, self._clock())
        if found is None:
            raise UserError(
                self._selection.why_none(verdicts),
                "'robot-preview encoders' lists what works: add one to encoders.order",
            )
        encoder, choice = found
        srt, targets = self._settings.srt, self._settings.profiles.targets
        fastest = max(target.fps for target in targets.values())
        return Plan(
            source=sources.plan(self._settings.source, fastest),
            encoder=encoder,
            choice=choice,
            profile=wish.profile,
            target=targets[wish.profile],
            highest_kbps=max(target.bitrate_kbps for target in targets.values()),
            listener=ListenerPlan(srt.bind, srt.port, srt.latency_ms, srt.key_length_bytes, wish.passphrase),
            key_frame_interval_s=self._settings.encoders.key_frame_interval_s,
        )
