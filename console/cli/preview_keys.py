"""Preview requests from keys, one at a time, and the message about the newest one. Pure."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Final

from console.cli.keyboard import Key
from console.client import (
    DesiredPreview,
    GatewayError,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
)
from console.presentation.preview_switch import (
    PROFILES,
    SUCCESS_SHOWN_S,
    Note,
    PreviewSwitch,
    is_on,
    next_camera,
)
from console.presentation.severity_style import SeverityStyle

_FAILURE_SHOWN_S: Final = 15.0
_PROFILES: Final = dict(zip((Key.LOW_BW, Key.BALANCED, Key.HIGH_QUALITY), PROFILES, strict=True))


class PreviewKeys:
    """Maps keys to requests, and their outcomes to messages.

    Args:
        clock: Monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._pending: DesiredPreview | None = None
        self._selected = PreviewProfile.UNKNOWN
        self._camera = ""
        """Selected while the preview is off."""
        self._note: Note | None = None
        self._until_s = math.inf

    def press(self, key: Key, preview: PreviewStatus) -> DesiredPreview | None:
        """Returns the request to send; None while another one is pending or there is none to send."""
        if self._pending:
            return None
        request = self._request(key, preview)
        if request is None:
            self._show(self._hint(key), SeverityStyle.QUIET, _FAILURE_SHOWN_S)
            return None
        self._pending = request
        self._show(f"{_title(request)}: request sent ...", SeverityStyle.QUIET)
        return request

    def done(self, outcome: PreviewChange | GatewayError) -> None:
        """Takes the outcome of the pending request."""
        request, self._pending = self._pending, None
        assert request  # noqa: S101  # callers send one at a time
        if isinstance(outcome, GatewayError):
            self._show(f"{_title(request)} failed: {outcome}", SeverityStyle.BAD, _FAILURE_SHOWN_S)
        elif not outcome.accepted:
            refusal = f"{_title(request)}: the robot refused: {outcome.message}"
            self._show(refusal, SeverityStyle.BAD, _FAILURE_SHOWN_S)
        elif outcome.preview.state is PreviewState.FAULTED:
            self._show(outcome.message, SeverityStyle.BAD, _FAILURE_SHOWN_S)
        else:
            self._selected, self._camera = PreviewProfile.UNKNOWN, ""
            self._show(outcome.message, SeverityStyle.QUIET, SUCCESS_SHOWN_S)

    def message(self) -> Note | None:
        """Returns the message about the newest request, until it expires."""
        return None if self._clock() > self._until_s else self._note

    def help(self, preview: PreviewStatus) -> Iterator[tuple[Key, str, bool]]:
        """Yields each key, what it does now, and whether that is in effect already."""
        yield Key.TOGGLE, "preview off" if is_on(preview) else "preview on", False
        selected = preview.profile if self._selected is PreviewProfile.UNKNOWN else self._selected
        for key, profile in _PROFILES.items():
            yield key, profile.value, profile is selected
        if len(preview.cameras) > 1:
            yield Key.CAMERA, f"camera ({self._camera or preview.wanted_camera})", False
        yield Key.QUIT, "quit", False

    def _request(self, key: Key, preview: PreviewStatus) -> DesiredPreview | None:
        switch = PreviewSwitch(is_on(preview), self._selected, camera=self._camera)
        if key is Key.TOGGLE:
            return switch.toggled()
        if key is Key.CAMERA:
            self._camera = next_camera(preview.cameras, self._camera or preview.wanted_camera)
            return switch.with_camera(self._camera) if self._camera else None
        if not switch.on:
            self._selected = _PROFILES[key]
        return switch.with_profile(_PROFILES[key])

    def _hint(self, key: Key) -> str:
        """Returns what a key has done that sends no request."""
        if key is not Key.CAMERA:
            return f"{self._selected.value}: p turns the preview on with it"
        if not self._camera:
            return "this robot has no other camera that works"
        return f"camera {self._camera}: p turns the preview on with it"

    def _show(self, text: str, style: SeverityStyle, for_s: float = math.inf) -> None:
        self._note, self._until_s = Note(text, style), self._clock() + for_s


def _title(request: DesiredPreview) -> str:
    if not request.enabled:
        return "preview off"
    if request.camera:
        return f"camera {request.camera}"
    return "preview on" if request.profile is PreviewProfile.UNKNOWN else f"preview {request.profile.value}"
