"""The line below the picture. Pure text."""

from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.state import Phase, ViewState
from console.words import joined, plural

_MIB = 1 << 20


def figures_line(newest: Frame | None, fps: float, redials: int) -> str:
    """What is received."""
    again = f"called again {redials}x" if redials else ""
    if newest is None:
        return again
    return joined(
        f"{newest.width}x{newest.height} {newest.codec} by {newest.decoder}", f"{fps:.0f} fps", again
    )


def beside_the_picture(state: ViewState) -> str:
    """What is wrong although pictures come; where none do, it is written over the picture."""
    return joined_sentences(state.reason, state.remedy) if state.phase is Phase.LIVE else ""


def joined_sentences(*sentences: str) -> str:
    """One after the other; the last one ends without a full stop."""
    text = ". ".join(part.strip().rstrip(".") for part in sentences if part.strip())
    return text[:1].upper() + text[1:]


def recording_line(recording: Recording | None) -> str:
    """What is kept; empty when nothing is to be."""
    if recording is None:
        return ""
    if recording.error:
        return recording.error.what
    gaps = f", {plural(recording.gaps, 'gap')}" if recording.gaps else ""
    return f"recording {recording.file.name}: {recording.size_bytes / _MIB:.1f} MiB{gaps}"
