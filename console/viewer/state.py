"""What a viewer says about its picture, worked out from what it knows. Pure."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from common.errors import UserError
from console.client import GatewayError, NotAllowed, NotTrusted, PreviewState, PreviewStatus

STILL_AFTER_S: Final = 0.4
"""A picture older than this is a still one. Pictures come every 67 ms at the slowest profile."""


class Phase(Enum):
    """What the picture on the screen is worth."""

    CONNECTING = "connecting"
    """No picture yet; the robot or its stream is being called."""
    LIVE = "live"
    FROZEN = "frozen"
    """The stream fell silent, and the robot has not said why."""
    OFF = "off"
    """Nobody wants a preview."""
    FAULTED = "faulted"
    """The robot says that its preview does not work, and why. It tries again by itself."""
    UNREACHABLE = "unreachable"
    """Neither the gateway nor the stream is heard."""
    NO_ACCESS = "no access"
    """The gateway refuses this login, or can't prove that it is the robot's; and there is no stream."""
    BLOCKED = "blocked"
    """This computer can't show the stream: wrong passphrase, unknown codec, something not installed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What a viewer knows. Moments are on `time.monotonic()`, in seconds.

    Args:
        preview: the gateway's newest word; None before the first.
        gateway_trouble: why the gateway does not answer; None while it does.
        picture_s: when the newest picture came; None when there is none to show.
        stream_trouble: why the newest call brought no picture; None while pictures come.
        blocked: whether calling again can't help.
        redials: calls beyond the first.
    """

    preview: PreviewStatus | None = None
    gateway_trouble: GatewayError | None = None
    picture_s: float | None = None
    stream_trouble: UserError | None = None
    blocked: bool = False
    redials: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewState:
    """What a screen shows beside the picture.

    Args:
        phase: what the picture is worth.
        still_s: age of the picture; None when there is none.
        reason: why there is no live picture; empty when nothing is known. Beside a live picture: what else is
            wrong.
        remedy: what to do; may be empty.
        redials: calls of the stream beyond the first since the viewer was opened.
    """

    phase: Phase
    still_s: float | None = None
    reason: str = ""
    remedy: str = ""
    redials: int = 0


def view_state(facts: Facts, now_s: float) -> ViewState:
    """The state at one moment."""
    still_s = None if facts.picture_s is None else max(0.0, now_s - facts.picture_s)
    phase, reason, remedy = _judged(facts, still_s)
    return ViewState(phase=phase, still_s=still_s, reason=reason, remedy=remedy, redials=facts.redials)


def _judged(facts: Facts, still_s: float | None) -> tuple[Phase, str, str]:
    if still_s is not None and still_s <= STILL_AFTER_S:
        return Phase.LIVE, *_words(facts.gateway_trouble)
    if facts.gateway_trouble:
        refused = isinstance(facts.gateway_trouble, NotAllowed | NotTrusted)
        return Phase.NO_ACCESS if refused else Phase.UNREACHABLE, *_words(facts.gateway_trouble)
    if facts.preview and not _wanted(facts.preview):
        return Phase.OFF, "", "Press P to switch it on"
    if facts.preview and facts.preview.state is PreviewState.FAULTED:
        return Phase.FAULTED, facts.preview.last_error or "the robot gives no reason", ""
    if facts.blocked:
        return Phase.BLOCKED, *_words(facts.stream_trouble)
    return Phase.CONNECTING if still_s is None else Phase.FROZEN, *_words(facts.stream_trouble)


def _wanted(preview: PreviewStatus) -> bool:
    return preview.state not in (PreviewState.DISABLED, PreviewState.STOPPING)


def _words(trouble: UserError | None) -> tuple[str, str]:
    return (trouble.what, trouble.remedy) if trouble else ("", "")
