"""State of the connection to the gateway, and its text for the operator."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from console.client import DeadlineExceeded, GatewayError, NotAllowed, NotTrusted, Unreachable
from console.presentation.formatting import age, sentence
from console.presentation.severity_style import SeverityStyle

_MS_PER_S = 1000
_ALARM_AFTER_S: Final = 3.0
"""Longer than a connection that comes back at once, and than the first attempts of a window at its start."""


class LinkState(Enum):
    """State of the connection."""

    CONNECTING = "connecting"
    """No answer yet, and no failure yet."""
    CONNECTED = "connected"
    LOST = "lost"
    """The latest attempt brought no answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The connection at one moment. Times are on this computer's monotonic clock, in seconds.

    Args:
        state: whether the robot answers.
        since_s: when the state began; for LOST: the time of the last answer, or of the first attempt.
        answer_ms: round trip of the latest call; None without one.
        error: why there is no answer; None unless lost.
        attempts: failed attempts since the last answer.
        next_try_s: time of the next attempt; None while one is under way.
    """

    state: LinkState
    since_s: float
    answer_ms: float | None = None
    error: GatewayError | None = None
    attempts: int = 0
    next_try_s: float | None = None


@dataclass(frozen=True, slots=True)
class LinkText:
    """Text of a link.

    Args:
        mark: one or two words.
        style: colour and shape of the mark.
        detail: the figure that goes with it.
        banner: the error and its remedy; empty without an error.
        retry: how long the error has lasted, and the next attempt; empty without an error.
    """

    mark: str
    style: SeverityStyle
    detail: str
    banner: str = ""
    retry: str = ""


def link_text(link: Link, target: str, now_s: float) -> LinkText:
    """Formats a link for the window."""
    duration = age(round((now_s - link.since_s) * _MS_PER_S))
    match link.state:
        case LinkState.CONNECTED:
            answers = "" if link.answer_ms is None else f"answers in {link.answer_ms:.0f} ms"
            return LinkText("connected", SeverityStyle.GOOD, answers)
        case LinkState.CONNECTING:
            return LinkText("connecting", SeverityStyle.QUIET, f"for {duration}")
        case LinkState.LOST:
            error = str(link.error or f"{target} does not answer")
            rejected = isinstance(link.error, NotAllowed | NotTrusted)
            lack = "No access" if rejected else "No answer"
            retry = f"{lack} for {duration}. Attempt {link.attempts + 1} {_when(link, rejected, now_s)}."
            mark = _mark(link.error)
            return LinkText(mark, SeverityStyle.BAD, f"for {duration}", sentence(error), retry)


def is_alarming(link: Link, now_s: float) -> bool:
    """Whether the robot has not answered for so long that the operator must hear of it."""
    return link.state is LinkState.LOST and now_s - link.since_s >= _ALARM_AFTER_S


def _mark(error: GatewayError | None) -> str:
    if isinstance(error, Unreachable | DeadlineExceeded):
        return "unreachable"
    # A gateway answers, but not with a status: a refusal, an older gateway, an error of its own.
    return "no answer" if error is None else error.kind.replace("_", " ")


def _when(link: Link, rejected: bool, now_s: float) -> str:
    if link.next_try_s is None:
        return "is under way"
    when = f"in {max(1, math.ceil(link.next_try_s - now_s))} s"
    return f"{when}, or as soon as another login is stored" if rejected else when
