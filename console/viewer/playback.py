"""State of the video on the screen, derived from the gateway's status and the stream. Pure."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from common.errors import UserError
from console.client import GatewayError, NotAllowed, NotTrusted, PreviewState, PreviewStatus
from console.viewer.redial import is_off

FROZEN_AFTER_S: Final = 0.4
"""An older frame counts as frozen. Frames come every 67 ms at the slowest profile."""


class PlaybackState(Enum):
    """State of the video on the screen."""

    CONNECTING = "connecting"
    """No frame yet; the robot or its stream is being connected to."""
    LIVE = "live"
    FROZEN = "frozen"
    """The stream stopped, and the robot has given no reason."""
    OFF = "off"
    """The preview is switched off."""
    FAULTED = "faulted"
    """The robot reports a fault of its preview, which restarts by itself."""
    UNREACHABLE = "unreachable"
    """Neither the gateway nor the stream answers."""
    NO_ACCESS = "no access"
    """The gateway rejects these credentials, or can't prove its identity; and there is no stream."""
    BLOCKED = "blocked"
    """This computer can't show the stream: wrong passphrase, unknown codec, a missing package."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaybackInputs:
    """Inputs of the playback state. Times are on `time.monotonic()`, in seconds.

    Args:
        preview: the gateway's latest status; None before the first.
        gateway_error: why the gateway does not answer; None while it does.
        frame_s: when the latest frame came; None when there is none to show.
        stream_error: why the latest connection brought no frame; None while frames come.
        blocked: whether redialing can't help.
        redials: connections beyond the first.
    """

    preview: PreviewStatus | None = None
    gateway_error: GatewayError | None = None
    frame_s: float | None = None
    stream_error: UserError | None = None
    blocked: bool = False
    redials: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Playback:
    """State of the video with its explanation.

    Args:
        state: state of the video.
        frame_age_s: age of the latest frame; None without one.
        reason: why there is no live video; empty if unknown. Beside live video: why the gateway does not
            answer.
        remedy: what to do; may be empty.
        redials: connections beyond the first since the viewer was opened.
    """

    state: PlaybackState
    frame_age_s: float | None = None
    reason: str = ""
    remedy: str = ""
    redials: int = 0


def playback(inputs: PlaybackInputs, now_s: float) -> Playback:
    """Returns the playback state at one moment."""
    frame_age_s = None if inputs.frame_s is None else max(0.0, now_s - inputs.frame_s)
    state, reason, remedy = _judge(inputs, frame_age_s)
    return Playback(
        state=state, frame_age_s=frame_age_s, reason=reason, remedy=remedy, redials=inputs.redials
    )


def _judge(inputs: PlaybackInputs, frame_age_s: float | None) -> tuple[PlaybackState, str, str]:
    if frame_age_s is not None and frame_age_s <= FROZEN_AFTER_S:
        return PlaybackState.LIVE, *_explained(inputs.gateway_error)
    if inputs.gateway_error:
        rejected = isinstance(inputs.gateway_error, NotAllowed | NotTrusted)
        state = PlaybackState.NO_ACCESS if rejected else PlaybackState.UNREACHABLE
        return state, *_explained(inputs.gateway_error)
    if inputs.preview and is_off(inputs.preview):
        return PlaybackState.OFF, "", "Press P to switch it on"
    if inputs.preview and inputs.preview.state is PreviewState.FAULTED:
        return PlaybackState.FAULTED, inputs.preview.last_error or "the robot gives no reason", ""
    if inputs.blocked:
        return PlaybackState.BLOCKED, *_explained(inputs.stream_error)
    state = PlaybackState.CONNECTING if frame_age_s is None else PlaybackState.FROZEN
    return state, *_explained(inputs.stream_error)


def _explained(error: UserError | None) -> tuple[str, str]:
    return (error.what, error.remedy) if error else ("", "")
