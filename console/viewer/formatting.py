"""Texts of a viewer: the banner over the video, and the line below it. Pure."""

from dataclasses import dataclass
from typing import Final

from console.presentation.formatting import joined, plural, sentence
from console.presentation.severity_style import SeverityStyle
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.playback import Playback, PlaybackState

_MIB: Final = 1 << 20
_TITLES: Final = {
    PlaybackState.CONNECTING: ("Connecting", SeverityStyle.QUIET),
    PlaybackState.FROZEN: ("Frozen", SeverityStyle.BAD),
    PlaybackState.OFF: ("Preview is off", SeverityStyle.QUIET),
    PlaybackState.FAULTED: ("Preview faulted", SeverityStyle.BAD),
    PlaybackState.UNREACHABLE: ("Robot unreachable", SeverityStyle.BAD),
    PlaybackState.NO_ACCESS: ("No access to the robot", SeverityStyle.BAD),
    PlaybackState.BLOCKED: ("This computer can't show the stream", SeverityStyle.BAD),
}


@dataclass(frozen=True, slots=True)
class Banner:
    """Text over video that is not live.

    Args:
        title: the state, with its duration.
        detail: the reason and the remedy; may be empty.
        style: its severity.
    """

    title: str
    detail: str
    style: SeverityStyle


def banner(playback: Playback) -> Banner | None:
    """Returns the banner of a playback state; None over live video."""
    if playback.state is PlaybackState.LIVE:
        return None
    title, style = _TITLES[playback.state]
    if playback.frame_age_s is not None:
        duration = f"for {_duration(playback.frame_age_s)}"
        frozen = playback.state is PlaybackState.FROZEN
        title = f"{title} {duration}" if frozen else f"{title} - video frozen {duration}"
    detail = joined_sentences(playback.reason, playback.remedy)
    if playback.redials and playback.state in (PlaybackState.CONNECTING, PlaybackState.FROZEN):
        redials = f"reconnected {playback.redials} times" if playback.redials > 1 else "reconnected once"
        detail = f"{detail} ({redials})" if detail else redials.capitalize()
    return Banner(title, detail, style)


def figures_line(latest: Frame | None, fps: float, redials: int) -> str:
    """Returns the stream's figures; empty before the first frame."""
    reconnected = f"reconnected {redials}x" if redials else ""
    if latest is None:
        return reconnected
    stream = f"{latest.width}x{latest.height} {latest.codec} by {latest.decoder}"
    return joined(stream, f"{fps:.0f} fps", reconnected)


def delivery_text(delivery: Delivery | None) -> str:
    """Returns the delivery with its figures: direct, round trip 20 ms, 3 packets given up.

    Where it is not direct, with why and what to type.
    """
    if delivery is None:
        return ""
    if delivery.kind is DeliveryChoice.SRT:
        why = ". ".join(filter(None, (delivery.reason, delivery.remedy)))
        return "SRT latency" + (f" ({why})" if why else "")
    return joined(
        "direct",
        f"round trip {delivery.rtt_ms:.0f} ms" if delivery.rtt_ms is not None else "",
        f"{plural(delivery.given_up, 'packet')} given up" if delivery.given_up else "",
        f"rejoined {delivery.rejoins}x" if delivery.rejoins else "",
    )


def live_note(playback: Playback) -> str:
    """Returns the error beside live video; without live video it is in the banner."""
    live = playback.state is PlaybackState.LIVE
    return joined_sentences(playback.reason, playback.remedy) if live else ""


def recording_line(recording: Recording | None) -> str:
    """Returns the progress or the error of a recording; empty without one."""
    if recording is None:
        return ""
    if recording.error:
        return recording.error.what
    gaps = plural(recording.gaps, "gap") if recording.gaps else ""
    return joined(f"recording {recording.file.name}: {mebibytes(recording.size_bytes)}", gaps)


def joined_sentences(*sentences: str) -> str:
    """Joins sentences; the last one ends without a full stop."""
    text = ". ".join(part.strip().rstrip(".") for part in sentences if part.strip())
    return sentence(text)


def mebibytes(count: int) -> str:
    """Formats a size: 1.2 MiB."""
    return f"{count / _MIB:.1f} MiB"


def _duration(seconds: float) -> str:
    """Formats a duration: 1.2 s; 1 min 15 s."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {int(seconds % 60):02} s"
