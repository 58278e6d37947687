"""What is written over a picture that is not live. Pure text."""

from dataclasses import dataclass
from typing import Final

from console.tone import Tone
from console.viewer.state import Phase, ViewState
from console.viewer.words import joined_sentences

_TITLES: Final = {
    Phase.CONNECTING: ("Connecting", Tone.QUIET),
    Phase.FROZEN: ("Frozen", Tone.BAD),
    Phase.OFF: ("Preview is off", Tone.QUIET),
    Phase.FAULTED: ("Preview faulted", Tone.BAD),
    Phase.UNREACHABLE: ("Robot unreachable", Tone.BAD),
    Phase.NO_ACCESS: ("No access to the robot", Tone.BAD),
    Phase.BLOCKED: ("This computer can't show the stream", Tone.BAD),
}


@dataclass(frozen=True, slots=True)
class Banner:
    """Words over the picture.

    Args:
        title: what is the matter, with how long it has been.
        detail: why, and what to do; may be empty.
        tone: how much it wants to be noticed.
    """

    title: str
    detail: str
    tone: Tone


def banner(state: ViewState) -> Banner | None:
    """What to write; None over a live picture."""
    if state.phase is Phase.LIVE:
        return None
    title, tone = _TITLES[state.phase]
    if state.still_s is not None:
        frozen = f"rozen for {_seconds(state.still_s)}"
        title = f"F{frozen}" if state.phase is Phase.FROZEN else f"{title} - picture f{frozen}"
    detail = joined_sentences(state.reason, state.remedy)
    if state.redials and state.phase in (Phase.CONNECTING, Phase.FROZEN):
        calls = f"called again {state.redials} times" if state.redials > 1 else "called again once"
        detail = f"{detail} ({calls})" if detail else calls.capitalize()
    return Banner(title, detail, tone)


def _seconds(duration_s: float) -> str:
    """1.2 s; 75 s; 5 min."""
    if duration_s < 60:
        return f"{duration_s:.1f} s"
    return f"{int(duration_s // 60)} min {int(duration_s % 60):02} s"
