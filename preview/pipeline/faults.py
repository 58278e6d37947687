"""What failed, told so that a person knows what to do."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.plan import Plan
from preview.pipeline.watchdogs import Silent

_DETAILS: Final = 120
"""Characters of GStreamer's details that a person is told; the log has them all."""


class Blame(Enum):
    """Which part failed. Only a failure of the encoder makes the next encoder take over."""

    SOURCE = "source"
    ENCODER = "encoder"
    LISTENER = "listener"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Fault:
    """A failure of a pipeline.

    Args:
        blame: which part.
        sentence: what happened and what to do, for `last_error`.
    """

    blame: Blame
    sentence: str


def from_message(message: Any, parts: Parts, plan: Plan) -> Fault:
    """Reads an ERROR message of the bus."""
    error, debug = message.parse_error()
    blame = _blame(message.src, parts)
    return Fault(blame, _sentence(blame, error, debug or "", plan))


def from_silence(silent: Silent, seconds: float, plan: Plan) -> Fault:
    """A watchdog's finding."""
    if silent is Silent.SOURCE:
        return Fault(
            Blame.SOURCE, _with_remedy(f"{plan.source.label} has sent no picture for {seconds:.1f} s", plan)
        )
    return Fault(Blame.ENCODER, f"encoder {plan.encoder.name} has given no picture for {seconds:.1f} s")


def ended(plan: Plan) -> Fault:
    """The source came to its end."""
    return Fault(Blame.SOURCE, _with_remedy(f"{plan.source.label} has ended", plan))


def _blame(culprit: Any, parts: Parts) -> Blame:
    for element, blame in (
        (parts.source, Blame.SOURCE),
        (parts.encoder, Blame.ENCODER),
        (parts.sink, Blame.LISTENER),
    ):
        if culprit is element or culprit.has_as_ancestor(element):
            return blame
    return Blame.OTHER


def _sentence(blame: Blame, error: Any, debug: str, plan: Plan) -> str:
    text = error.message.rstrip(".")
    match blame:
        case Blame.SOURCE:
            return _with_remedy(f"{plan.source.label} failed: {_reason(text, debug)}", plan)
        case Blame.ENCODER:
            return f"encoder {plan.encoder.name} failed: {_reason(text, debug)}"
        case Blame.LISTENER:
            return _listener_sentence(error, debug, plan)
        case Blame.OTHER:
            return f"the pipeline failed: {_reason(text, debug)}. The log of the preview service says more."


def _listener_sentence(error: Any, debug: str, plan: Plan) -> str:
    port = plan.listener.port
    if error.matches(Gst.ResourceError.quark(), Gst.ResourceError.OPEN_WRITE) or "bind" in debug:
        return (
            f"UDP port {port} on {plan.listener.bind} can't be used: another program has it, or the address "
            "is not this machine's."
            f" 'ss -lunp sport = :{port}' names the program; or choose another srt.port."
        )
    return f"the SRT listener on port {port} failed: {_reason(error.message.rstrip('.'), debug)}."


def _reason(text: str, debug: str) -> str:
    """GStreamer's own text, and the last line of its details where that says more."""
    last = debug.strip().rsplit("\n", 1)[-1].strip().rstrip(".")
    if not last or "(): " in last or last in text or last.startswith(("../", "/")):
        return text
    return f"{text} ({last[:_DETAILS] + '...' if len(last) > _DETAILS else last})"


def _with_remedy(text: str, plan: Plan) -> str:
    return f"{text}. {plan.source.remedy}." if plan.source.remedy else f"{text}."


def unexplained(plan: Plan) -> Fault:
    """Starting failed and no element said why."""
    return Fault(Blame.ENCODER, f"encoder {plan.encoder.name} could not be started and gave no reason")
