"""Which encoder is used: the first of the order that has proven itself and has not failed since. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from preview.encoders.catalogue import Encoder
from preview.values import EncoderChoice


@dataclass(frozen=True, slots=True)
class Verdict:
    """What came of trying an encoder.

    Args:
        present: whether the element exists on this machine.
        proven: whether it really encoded.
        reason: why not, for a person; empty when proven.
        first_byte_ms: from the first frame in to the first byte out; None when not proven.
    """

    present: bool
    proven: bool
    reason: str = ""
    first_byte_ms: float | None = None


@dataclass(frozen=True, slots=True)
class _Failure:
    reason: str
    at: float


class Selection:
    """Remembers which encoders failed in the pipeline, and chooses.

    Args:
        order: what may be used, best first.
        forgive_after_s: how long a failed one is passed over.
    """

    def __init__(self, order: Sequence[Encoder], forgive_after_s: float) -> None:
        self._order = tuple(order)
        self._forgive_after_s = forgive_after_s
        self._failures: dict[str, _Failure] = {}

    @property
    def order(self) -> tuple[Encoder, ...]:
        """What may be used, best first."""
        return self._order

    def pass_over(self, name: str, reason: str, now: float) -> None:
        """An encoder failed in the pipeline: the next one takes over."""
        self._failures[name] = _Failure(reason, now)

    def choose(self, verdicts: Mapping[str, Verdict], now: float) -> tuple[Encoder, EncoderChoice] | None:
        """The encoder to use, and how it stands to the one that was wanted.

        When all proven ones have failed, all are forgiven: trying again is better than giving up.

        Args:
            verdicts: by name; those that are missing count as not proven.
            now: monotonic seconds.

        Returns:
            None when no encoder is proven.
        """
        self._failures = {
            name: failure
            for name, failure in self._failures.items()
            if now - failure.at < self._forgive_after_s
        }
        proven = [e for e in self._order if e.name in verdicts and verdicts[e.name].proven]
        if not proven:
            return None
        if all(encoder.name in self._failures for encoder in proven):
            self._failures.clear()
        chosen = next(encoder for encoder in proven if encoder.name not in self._failures)
        return chosen, self._explained(chosen, verdicts)

    def has_another(self, verdicts: Mapping[str, Verdict]) -> bool:
        """Whether a proven encoder is left that has not failed."""
        return any(
            e.name in verdicts and verdicts[e.name].proven and e.name not in self._failures
            for e in self._order
        )

    def why_none(self, verdicts: Mapping[str, Verdict]) -> str:
        """Says what is wrong with every encoder that exists, where none is proven."""
        tried = [
            f"{e.name}: {verdicts[e.name].reason}"
            for e in self._order
            if e.name in verdicts and verdicts[e.name].present
        ]
        found = "; ".join(tried) or "none of their GStreamer elements is installed"
        return f"no encoder of {', '.join(e.name for e in self._order)} works ({found})"

    def _explained(self, chosen: Encoder, verdicts: Mapping[str, Verdict]) -> EncoderChoice:
        wanted = self._order[0]
        return EncoderChoice(
            name=chosen.name,
            codec=chosen.codec,
            hardware=chosen.hardware,
            wanted=wanted.name,
            fallback_reason="" if chosen is wanted else self._why_not(wanted, verdicts),
        )

    def _why_not(self, wanted: Encoder, verdicts: Mapping[str, Verdict]) -> str:
        if wanted.name in self._failures:
            return self._failures[wanted.name].reason
        verdict = verdicts.get(wanted.name)
        return verdict.reason if verdict else f"{wanted.name} was not tried"
