"""Faults of a pipeline: which part failed, and the text that explains it to people."""

from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.events import Blame, Fault
from preview.pipeline.plan import Plan
from preview.pipeline.watchdogs import Silent

_DETAILS: Final = 120
"""Characters of GStreamer's debug text that are quoted; the log has all of it."""


def from_message(message: Any, parts: Parts, plan: Plan) -> Fault:
    """Returns the fault of an ERROR message of the bus."""
    error, debug = message.parse_error()
    blame = _blame(message.src, parts)
    return Fault(blame, _text(blame, error, debug or "", plan))


def from_silence(silent: Silent, seconds: float, plan: Plan) -> Fault:
    """Returns the fault that a watchdog found."""
    if silent is Silent.SOURCE:
        return _of_source(f"{plan.source.label} has sent no frame for {seconds:.1f} s", plan)
    return Fault(Blame.ENCODER, f"encoder {plan.encoder.name} has produced no frame for {seconds:.1f} s")


def end_of_stream(plan: Plan) -> Fault:
    """Returns the fault of a source that came to its end."""
    return _of_source(f"{plan.source.label} has ended", plan)


def unexplained(plan: Plan) -> Fault:
    """Returns the fault of a pipeline that did not start while no element posted an error."""
    return Fault(Blame.ENCODER, f"encoder {plan.encoder.name} could not be started and gave no reason")


def encoder_hung(plan: Plan, when: str) -> Fault:
    """Returns the fault of an encoder whose driver did not return from a call."""
    return Fault(Blame.ENCODER, f"encoder {plan.encoder.name} hung when {when}")


def _of_source(text: str, plan: Plan) -> Fault:
    return Fault(Blame.SOURCE, f"{text}. {plan.source.remedy}." if plan.source.remedy else f"{text}.")


def _blame(culprit: Any, parts: Parts) -> Blame:
    for element, blame in (
        (parts.source, Blame.SOURCE),
        (parts.encoder, Blame.ENCODER),
        (parts.sink, Blame.LISTENER),
    ):
        if culprit is element or culprit.has_as_ancestor(element):
            return blame
    return Blame.OTHER


def _text(blame: Blame, error: Any, debug: str, plan: Plan) -> str:
    reason = _reason(error.message.rstrip("."), debug)
    match blame:
        case Blame.SOURCE:
            return _of_source(f"{plan.source.label} failed: {reason}", plan).text
        case Blame.ENCODER:
            return f"encoder {plan.encoder.name} failed: {reason}"
        case Blame.LISTENER:
            port = plan.srt.port
            if error.matches(Gst.ResourceError.quark(), Gst.ResourceError.OPEN_WRITE) or "bind" in debug:
                return (
                    f"UDP port {port} on {plan.srt.bind} can't be used: another program has it, or the"
                    f" address is not this machine's. 'ss -lunp sport = :{port}' names the program; or choose"
                    " another srt.port."
                )
            return f"the SRT listener on port {port} failed: {reason}."
        case Blame.OTHER:
            return f"the pipeline failed: {reason}. The log of the preview service has more."


def _reason(text: str, debug: str) -> str:
    """Returns GStreamer's error text, and the last line of its debug text where that adds something."""
    last = debug.strip().rsplit("\n", 1)[-1].strip().rstrip(".")
    if not last or "(): " in last or last in text or last.startswith(("../", "/")):
        return text
    return f"{text} ({last[:_DETAILS] + '...' if len(last) > _DETAILS else last})"
