"""What can go wrong with the hub: one exception, whose reason decides what follows."""

from enum import Enum
from typing import Any, Final


class HubReason(Enum):
    """Why the hub did not do what it was asked to."""

    UNREACHABLE = "unreachable"
    """There is no connection, or it broke before the answer."""
    REFUSED = "refused"
    """The hub does not accept these credentials (any more), or they do not permit this."""
    TIMEOUT = "timeout"
    """The connection stands, but no answer came in time. The request may have been carried out."""
    NO_QUORUM = "no quorum"
    """Too few of the hub's nodes are up, or they are electing a leader."""
    NO_RESPONDERS = "no responders"
    """No stream and no program takes this subject: not set up, without a quorum, or no receiver runs."""
    FULL = "full"
    """A stream or the account has reached its limit of bytes or messages."""
    TOO_LARGE = "too large"
    """The message exceeds the limit for one message. It will not become possible by itself."""
    TOO_MANY = "too many"
    """There is more than is read at once. A part of it may be read."""
    MISSING = "missing"
    """The hub has no such stream, consumer, key or message."""
    INVALID = "invalid"
    """The hub does not understand the request, or contradicts it."""


_LONGEST_TEXT: Final = 600
"""Characters of a sentence, in a log and in the status of a robot."""


class HubError(Exception):
    """The hub did not do what it was asked to.

    Args:
        reason: why, for programs.
        text: what happened, for people. The words of the hub in it may be anything: they are cut, and what is
            not printable becomes a blank.
        code: JetStream's error code (err_code); 0 where it gave none.
    """

    def __init__(self, reason: HubReason, text: str, code: int = 0) -> None:
        super().__init__(_plain(text))
        self.reason = reason
        self.code = code


class UnreachableError(HubError):
    """There is no connection to the hub, or it broke before the answer."""

    def __init__(self, text: str) -> None:
        super().__init__(HubReason.UNREACHABLE, text)


class RefusedError(HubError):
    """The hub does not accept the credentials (unknown, expired, revoked), or they do not permit this."""

    def __init__(self, text: str) -> None:
        super().__init__(HubReason.REFUSED, text)


def _plain(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text[:_LONGEST_TEXT])


_STORE_FAILED: Final = 10077
"""JSStreamStoreFailedF: whatever the stream's store refuses. The sentence says why."""
_REPEATED: Final = "maximum messages per subject exceeded"
_FULL: Final = ("maximum bytes exceeded", "maximum messages exceeded", "no space left on device")
_REASONS: Final = {
    10005: HubReason.NO_QUORUM,  # no suitable peers for placement: a node is missing
    10008: HubReason.NO_QUORUM,  # JetStream system temporarily unavailable
    10009: HubReason.NO_QUORUM,  # JetStream cluster not active
    10023: HubReason.FULL,  # insufficient resources
    10028: HubReason.FULL,  # resource limits exceeded for the server
    10047: HubReason.FULL,  # insufficient storage resources available
    10002: HubReason.FULL,  # resource limits exceeded for the account
    10054: HubReason.TOO_LARGE,  # message size exceeds maximum allowed
    10014: HubReason.MISSING,  # consumer not found
    10037: HubReason.MISSING,  # no message found
    10059: HubReason.MISSING,  # stream not found
    10118: HubReason.NO_QUORUM,  # stream is offline
    10119: HubReason.NO_QUORUM,  # consumer is offline
    10167: HubReason.FULL,  # too many requests wait for the stream (2.10.17 and later)
}
"""By JetStream's err_code (server/errors.json of nats-server)."""


def is_repeat(error: HubError) -> bool:
    """Returns whether a stream with one message per subject refused a second one: the first was delivered."""
    return error.code == _STORE_FAILED and _REPEATED in str(error)


def api_error(error: Any) -> HubError:
    """Returns the exception for the member "error" of a JetStream answer, which may be anything."""
    if not isinstance(error, dict):
        return HubError(HubReason.INVALID, "the hub's answer has an error of an unknown form")
    code = error.get("err_code", 0)
    if not isinstance(code, int):
        code = 0
    description = error.get("description")
    text = description[:200] if isinstance(description, str) else "no description"
    reason = _REASONS.get(code)
    if reason is None and code == _STORE_FAILED and any(sentence in text for sentence in _FULL):
        reason = HubReason.FULL
    if reason is None:
        reason = HubReason.NO_QUORUM if error.get("code") == 503 else HubReason.INVALID
    return HubError(reason, f"the hub refuses: {text}", code)
