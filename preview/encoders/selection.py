"""Selection of the encoder: the first one in the order that is proven and has not failed since. Pure."""

import time
from collections.abc import Callable, Collection, Sequence

from common.errors import UserError
from preview.encoders.catalogue import Encoder
from preview.encoders.probe import TrialProber, Verdict
from preview.state.values import EncoderChoice


class Selection:
    """Chooses encoders and remembers those that failed in a pipeline.

    Args:
        order: allowed encoders, best first.
        forgive_after_s: how long a failed encoder is passed over.
        prober: runs the trials.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        order: Sequence[Encoder],
        forgive_after_s: float,
        prober: TrialProber,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._order = tuple(order)
        self._forgive_after_s = forgive_after_s
        self._prober = prober
        self._clock = clock
        self._failures: dict[str, tuple[str, float]] = {}
        """Reason and time of each failure, by encoder name."""

    def pass_over(self, name: str, reason: str) -> None:
        """Excludes an encoder that failed in a pipeline, for `forgive_after_s`."""
        self._failures[name] = (reason, self._clock())

    def trust(self, names: Collection[str]) -> None:
        """Counts these encoders as proven without a trial: the previous process proved them.

        One that does not work any more fails in the pipeline, and the next one takes over.
        """
        for encoder in self._order:
            if encoder.name in names:
                self._prober.verdicts[encoder.name] = Verdict(present=True, proven=True)

    @property
    def proven(self) -> list[str]:
        """Names of the proven encoders that have not failed."""
        return [encoder.name for encoder in self._proven() if encoder.name not in self._failures]

    @property
    def order_of_trials(self) -> list[Encoder]:
        """All encoders, those last that are passed over: a process that follows a crash needs the others."""
        recent = self._recent_failures()
        return sorted(self._order, key=lambda encoder: encoder.name in recent)

    async def probe(self) -> bool:
        """Runs trials until an encoder is proven that has not failed; False when there is none."""
        for encoder in self.order_of_trials:
            if self.proven:
                break
            await self._prober.verdict(encoder)
        return bool(self.proven)

    def choose(self) -> tuple[Encoder, EncoderChoice]:
        """Returns the encoder to use, and the choice as reported in the status; to be called after `probe`.

        When all proven encoders have failed, all failures are forgotten: another attempt is better than none.

        Raises:
            UserError: no encoder is proven.
        """
        recent = self._recent_failures()
        proven = self._proven()
        if not proven:
            raise UserError(
                self._why_none(), "'robot-preview encoders' lists what works: add one to encoders.order"
            )
        self._failures = {} if all(encoder.name in recent for encoder in proven) else recent
        chosen = next(encoder for encoder in proven if encoder.name not in self._failures)
        wanted = self._order[0]
        reason = "" if chosen is wanted else self._why_not(wanted)
        return chosen, EncoderChoice(chosen.name, chosen.hardware, wanted.name, reason)

    def _recent_failures(self) -> dict[str, tuple[str, float]]:
        now = self._clock()
        return {n: (why, at) for n, (why, at) in self._failures.items() if now - at < self._forgive_after_s}

    def _proven(self) -> list[Encoder]:
        verdicts = self._prober.verdicts
        return [e for e in self._order if e.name in verdicts and verdicts[e.name].proven]

    def _why_not(self, encoder: Encoder) -> str:
        if encoder.name in self._failures:
            return self._failures[encoder.name][0]
        verdict = self._prober.verdicts.get(encoder.name)
        return verdict.reason if verdict else f"{encoder.name} was not tried"

    def _why_none(self) -> str:
        verdicts = self._prober.verdicts
        names = [encoder.name for encoder in self._order]
        tried = [f"{n}: {verdicts[n].reason}" for n in names if n in verdicts and verdicts[n].present]
        found = "; ".join(tried) or "none of their GStreamer elements is installed"
        return f"no encoder of {', '.join(names)} works ({found})"
