"""Faults of a pipeline: which part failed, and the text that explains it to people."""

from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.events import Blame, Fault
from preview.pipeline.plan import Plan

_DETAILS: Final = 120
"""Characters of GStreamer's debug text that are quoted; the log has all of it."""


def of(blame: Blame, what: str, plan: Plan) -> Fault:
    """Returns the fault of a part, with the remedy where there is one.

    Args:
        blame: the part.
        what: what it did, as the predicate of a sentence.
        plan: of the pipeline.
    """
    match blame:
        case Blame.SOURCE:
            remedy = f" {plan.source.remedy}." if plan.source.remedy else ""
            text = f"{plan.source.label} {what}.{remedy}"
        case Blame.ENCODER:
            text = f"encoder {plan.encoder.name} {what}"
        case Blame.LISTENER:
            text = f"the SRT listener on port {plan.srt.port} {what}."
        case Blame.OTHER:
            text = f"the pipeline {what}. The log of the preview service has more."
    return Fault(blame, text)


def from_message(message: Any, parts: Parts, plan: Plan) -> Fault:
    """Returns the fault of an ERROR message of the bus."""
    elements = _elements(parts).items()
    blame = next((b for b, e in elements if is_within(message.src, e)), Blame.OTHER)
    return of(blame, f"failed: {reason(message)}", plan)


def is_within(element: Any, other: Any) -> bool:
    """Whether an element is another one, or a part of it."""
    return bool(element is other or element.has_as_ancestor(other))


def reason(message: Any) -> str:
    """Returns the text of an ERROR message of the bus."""
    return _reason(*message.parse_error())


def of_listener(message: Any, plan: Plan) -> Fault:
    """Returns the fault of an ERROR message of the listener's bus."""
    error, debug = message.parse_error()
    taken = error.matches(Gst.ResourceError.quark(), Gst.ResourceError.OPEN_WRITE) or "bind" in (debug or "")
    if taken:
        port = plan.srt.port
        return Fault(
            Blame.LISTENER,
            f"UDP port {port} on {plan.srt.bind} can't be used: another program has it, or the address is not"
            f" this machine's. 'ss -lunp sport = :{port}' names the program; or choose another srt.port.",
        )
    return of(Blame.LISTENER, f"failed: {_reason(error, debug)}", plan)


def blocked(parts: Parts, plan: Plan, seconds: float) -> Fault:
    """Returns the fault of a pipeline whose start does not return.

    A bin changes its elements one after the other, from the last to the source, so the first one in this
    order whose change is still pending is the one that blocks.
    """
    pending = [
        blame for blame, e in _elements(parts).items() if e.get_state(0).pending != Gst.State.VOID_PENDING
    ]
    blame = pending[0] if pending else Blame.OTHER
    return of(blame, f"has not started within {seconds:g} s", plan)


def _elements(parts: Parts) -> dict[Blame, Any]:
    return {Blame.ENCODER: parts.encoder, Blame.SOURCE: parts.source}


def _reason(error: Any, debug: str | None) -> str:
    """Returns GStreamer's error text, and the last line of its debug text where that adds something."""
    text: str = error.message.rstrip(".")
    last = (debug or "").strip().rsplit("\n", 1)[-1].strip().rstrip(".")
    if not last or "(): " in last or last in text or last.startswith(("../", "/")):
        return text
    return f"{text} ({last[:_DETAILS] + '...' if len(last) > _DETAILS else last})"
