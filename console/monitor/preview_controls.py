"""The preview's controls: what they say, what they do, and when they may be touched."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from console.client import GatewayError, PreviewProfile, PreviewState, PreviewStatus
from console.monitor.link import Phase
from console.monitor.state import MonitorState, Request, Wish
from console.tone import Tone
from console.words import joined

PROFILES: Final = (PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY)
"""In the order of the keys 1 to 3."""
_GOOD_NEWS_FOR_S = 5.0
_TONES = {
    PreviewState.RUNNING: Tone.GOOD,
    PreviewState.STARTING: Tone.WARNING,
    PreviewState.STOPPING: Tone.WARNING,
    PreviewState.FAULTED: Tone.BAD,
    PreviewState.DISABLED: Tone.QUIET,
    PreviewState.UNKNOWN: Tone.QUIET,
}
_WANTED = (PreviewState.RUNNING, PreviewState.STARTING, PreviewState.FAULTED)


@dataclass(frozen=True, slots=True)
class Note:
    """A sentence beside the controls."""

    text: str
    tone: Tone


@dataclass(frozen=True, slots=True)
class Controls:
    """The controls at one moment.

    Args:
        enabled: whether they may be touched.
        wanted: whether the preview is on, or on its way there: the switch then turns it off.
        profile: the one that is in force, or that the switch would begin with.
        mark: the preview's state in a word.
        tone: how much the word wants to be noticed.
        summary: what runs.
        notes: what became of the operator's request, then what the robot has to say by itself.
    """

    enabled: bool
    wanted: bool
    profile: PreviewProfile
    mark: str
    tone: Tone
    summary: str
    notes: tuple[Note, ...]

    def switched(self) -> Wish:
        """The wish behind the switch."""
        return Wish(False) if self.wanted else Wish(True, self.profile)

    def chosen(self, profile: PreviewProfile) -> Wish | None:
        """The wish behind a profile's button; None while the preview is off: it marks what comes next."""
        return Wish(True, profile) if self.wanted else None


def controls(state: MonitorState, marked: PreviewProfile | None, now_s: float) -> Controls:
    """The controls for a state.

    Args:
        state: the newest.
        marked: the profile that the operator marked while the preview was off.
        now_s: on the monotonic clock.
    """
    preview = state.snapshot.status.preview if state.snapshot else None
    busy = state.request is not None and state.request.under_way
    current = PreviewState.UNKNOWN if preview is None or state.outdated(now_s) else preview.state
    wanted = preview is not None and preview.state in _WANTED
    return Controls(
        enabled=preview is not None and state.link.phase is Phase.CONNECTED and not busy,
        wanted=wanted,
        profile=_profile(preview, None if wanted else marked),
        mark=current.value.upper(),
        tone=_TONES[current],
        summary=_summary(preview) if preview and current is not PreviewState.UNKNOWN else "",
        notes=(*_of_the_request(state.request, now_s), *(_of_the_robot(preview) if preview else ())),
    )


def _profile(preview: PreviewStatus | None, marked: PreviewProfile | None) -> PreviewProfile:
    if marked is not None:
        return marked
    if preview is None or preview.profile is PreviewProfile.UNKNOWN:
        return PreviewProfile.BALANCED
    return preview.profile


def _summary(preview: PreviewStatus) -> str:
    encoder, video = preview.encoder, preview.video
    return joined(
        f"{video.width_px}x{video.height_px} at {video.fps:g} fps" if video else "",
        encoder.name if encoder else "",
        "in hardware" if encoder and encoder.hardware else "",
    )


def _of_the_request(request: Request | None, now_s: float) -> Iterator[Note]:
    if request is None:
        return
    outcome = request.outcome
    if outcome is None:
        yield Note("The robot is asked ...", Tone.QUIET)
    elif isinstance(outcome, GatewayError):
        yield Note(f"Not done: {outcome}", Tone.BAD)
    elif not outcome.accepted:
        yield Note(f"The robot refused: {outcome.message}", Tone.BAD)
    elif outcome.preview.state is not PreviewState.FAULTED and now_s - request.ended_s < _GOOD_NEWS_FOR_S:
        # Why it is faulted is the robot's own note.
        yield Note(outcome.message, Tone.QUIET)


def _of_the_robot(preview: PreviewStatus) -> Iterator[Note]:
    if preview.last_error:
        yield Note(preview.last_error, Tone.BAD if preview.state is PreviewState.FAULTED else Tone.WARNING)
    elif not preview.service_reachable:
        yield Note("The preview service on the robot does not answer the gateway", Tone.WARNING)
    if preview.encoder and preview.encoder.fallback_reason:
        yield Note(f"Wanted {preview.encoder.wanted}: {preview.encoder.fallback_reason}", Tone.WARNING)
    if preview.bitrate_reason:
        yield Note(f"Bit rate: {preview.bitrate_reason}", Tone.WARNING)
