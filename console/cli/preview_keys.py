"""Preview requests from keys, one at a time, and the message about the newest one. Pure."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from console.cli.keyboard import PROFILES, Key
from console.client import (
    GatewayError,
    PreviewChange,
    PreviewProfile,
    PreviewRequest,
    PreviewState,
    PreviewStatus,
)
from console.presentation.severity_style import SeverityStyle

_SUCCESS_FOR_S: Final = 5.0
_FAILURE_FOR_S: Final = 15.0
_ON: Final = (PreviewState.STARTING, PreviewState.RUNNING, PreviewState.FAULTED)


@dataclass(frozen=True, slots=True)
class Message:
    """A sentence about the newest request."""

    text: str
    style: SeverityStyle
    until_s: float = float("inf")


class PreviewKeys:
    """Maps keys to requests, and their outcomes to messages.

    Args:
        clock: Monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._pending: PreviewRequest | None = None
        self._selected = PreviewProfile.UNKNOWN
        self._message: Message | None = None

    def press(self, key: Key, preview: PreviewStatus) -> PreviewRequest | None:
        """Returns the request to send; None while another one is pending or there is none to send."""
        if self._pending:
            return None
        request = self._request(key, preview)
        if request is None:
            hint = f"{self._selected.value}: p turns the preview on with it"
            self._show(hint, SeverityStyle.QUIET, _FAILURE_FOR_S)
            return None
        self._pending = request
        self._message = Message(f"{_title(request)}: request sent ...", SeverityStyle.QUIET)
        return request

    def done(self, outcome: PreviewChange | GatewayError) -> None:
        """Takes the outcome of the pending request."""
        request, self._pending = self._pending, None
        assert request  # noqa: S101  # callers send one at a time
        if isinstance(outcome, GatewayError):
            self._show(f"{_title(request)} failed: {outcome}", SeverityStyle.BAD, _FAILURE_FOR_S)
        elif not outcome.accepted:
            refusal = f"{_title(request)}: the robot refused: {outcome.message}"
            self._show(refusal, SeverityStyle.BAD, _FAILURE_FOR_S)
        elif outcome.preview.state is PreviewState.FAULTED:
            self._show(outcome.message, SeverityStyle.BAD, _FAILURE_FOR_S)
        else:
            self._selected = PreviewProfile.UNKNOWN
            self._show(outcome.message, SeverityStyle.QUIET, _SUCCESS_FOR_S)

    def message(self) -> Message | None:
        """Returns the message about the newest request, until it expires."""
        if self._message and self._clock() > self._message.until_s:
            self._message = None
        return self._message

    def help(self, preview: PreviewStatus) -> Iterator[tuple[Key, str, bool]]:
        """Yields each key, what it does now, and whether that is in effect already."""
        yield Key.TOGGLE, "preview off" if preview.state in _ON else "preview on", False
        selected = preview.profile if self._selected is PreviewProfile.UNKNOWN else self._selected
        for key, profile in PROFILES.items():
            yield key, profile.value, profile is selected
        yield Key.QUIT, "quit", False

    def _request(self, key: Key, preview: PreviewStatus) -> PreviewRequest | None:
        on = preview.state in _ON
        if key is Key.TOGGLE:
            return PreviewRequest(False) if on else PreviewRequest(True, self._selected)
        if on:
            return PreviewRequest(True, PROFILES[key])
        self._selected = PROFILES[key]
        return None

    def _show(self, text: str, style: SeverityStyle, for_s: float) -> None:
        self._message = Message(text, style, self._clock() + for_s)


def _title(request: PreviewRequest) -> str:
    if not request.enabled:
        return "preview off"
    return "preview on" if request.profile is PreviewProfile.UNKNOWN else f"preview {request.profile.value}"
