"""The connection to the gateway, as the operator should know it."""

import math
from dataclasses import dataclass
from enum import Enum

from console.client import DeadlineExceeded, GatewayError, NotAllowed, NotTrusted, Unreachable
from console.tone import Tone
from console.words import age

_MS_PER_S = 1000


class Phase(Enum):
    """Whether the robot answers."""

    CONNECTING = "connecting"
    """It was not heard yet, and nothing says that it won't be."""
    CONNECTED = "connected"
    LOST = "lost"
    """The newest attempt brought no answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The connection at one moment. Moments are on this computer's monotonic clock, in seconds.

    Args:
        phase: whether the robot answers.
        since_s: when the phase began; for LOST: when the robot was heard last, or first asked.
        answer_ms: how long the newest answer took; None where nothing was asked for it.
        trouble: why there is no answer; None unless lost.
        attempts: failed attempts since the robot was heard last.
        next_try_s: when it is asked again; None while it is being asked.
    """

    phase: Phase
    since_s: float
    answer_ms: float | None = None
    trouble: GatewayError | None = None
    attempts: int = 0
    next_try_s: float | None = None


@dataclass(frozen=True, slots=True)
class LinkWords:
    """A link in words.

    Args:
        mark: one or two words.
        tone: how much they want to be noticed.
        detail: the figure that goes with them.
        banner: what is wrong and what to do; empty while all is well.
        retry: how long it has been so, and what happens next; empty while all is well.
    """

    mark: str
    tone: Tone
    detail: str
    banner: str = ""
    retry: str = ""


def link_words(link: Link, target: str, now_s: float) -> LinkWords:
    """What the window says of the connection."""
    lasting = age(round((now_s - link.since_s) * _MS_PER_S))
    match link.phase:
        case Phase.CONNECTED:
            answers = "" if link.answer_ms is None else f"answers in {link.answer_ms:.0f} ms"
            return LinkWords("connected", Tone.GOOD, answers)
        case Phase.CONNECTING:
            return LinkWords("connecting", Tone.QUIET, f"for {lasting}")
        case Phase.LOST:
            trouble = str(link.trouble or f"{target} does not answer")
            banner = trouble[:1].upper() + trouble[1:]
            retry = f"{_lack(link.trouble)} for {lasting}. {_retry(link, now_s)}"
            return LinkWords(_trouble_mark(link.trouble), Tone.BAD, f"for {lasting}", banner, retry)


def _trouble_mark(trouble: GatewayError | None) -> str:
    if isinstance(trouble, Unreachable | DeadlineExceeded):
        return "unreachable"
    # Somebody is there, but what comes can't be used: a refusal, an older gateway, an error of its own.
    return "no answer" if trouble is None else trouble.kind.replace("_", " ")


def _lack(trouble: GatewayError | None) -> str:
    return "No access" if isinstance(trouble, NotAllowed | NotTrusted) else "No answer"


def _retry(link: Link, now_s: float) -> str:
    if link.next_try_s is None:
        return f"Attempt {link.attempts + 1} is under way."
    when = f"in {max(1, math.ceil(link.next_try_s - now_s))} s"
    if isinstance(link.trouble, NotAllowed | NotTrusted):
        when = f"{when}, or as soon as another login is stored"
    return f"Attempt {link.attempts + 1} {when}."
