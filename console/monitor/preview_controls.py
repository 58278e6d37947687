"""Model of the preview's controls: their texts, their requests, and when they are enabled."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from console.client import Camera, CameraState, GatewayError, PreviewProfile, PreviewState, PreviewStatus
from console.monitor.link import LinkState
from console.monitor.monitor_state import MonitorState, PreviewRequest
from console.presentation.formatting import joined
from console.presentation.preview_switch import SUCCESS_SHOWN_S, Note, PreviewSwitch, is_on
from console.presentation.severity_style import PREVIEW_STYLES, SeverityStyle


@dataclass(frozen=True, slots=True)
class Controls(PreviewSwitch):
    """The controls at one moment.

    Args:
        enabled: whether they can be used.
        mark: the preview's state in a word.
        style: colour and shape of the mark.
        summary: size, rate and encoder.
        answers: the outcome of the operator's request.
        conditions: the robot's own messages.
        beside_faults: of these, the ones that no active fault says.
        cameras: of the robot, in its order; the wanted one is `wanted_camera`.
        wanted_camera: the one chosen last, or selected for the next start.
    """

    enabled: bool
    mark: str
    style: SeverityStyle
    summary: str
    answers: tuple[Note, ...]
    conditions: tuple[Note, ...]
    beside_faults: tuple[Note, ...] = ()
    cameras: tuple[Camera, ...] = ()
    wanted_camera: str = ""

    @property
    def notes(self) -> tuple[Note, ...]:
        """The answers, then the conditions."""
        return (*self.answers, *self.conditions)


def controls(
    state: MonitorState, selected: PreviewProfile | None, now_s: float, selected_camera: str = ""
) -> Controls:
    """Returns the controls for a state.

    Args:
        state: the latest.
        selected: the profile that the operator selected while the preview was off.
        now_s: on the monotonic clock.
        selected_camera: the camera that the operator selected while the preview was off; empty for none.
    """
    preview = state.snapshot.status.preview if state.snapshot else None
    current = PreviewState.UNKNOWN if preview is None or state.outdated(now_s) else preview.state
    on = preview is not None and is_on(preview)
    pending = state.request is not None and state.request.pending
    said = {fault.id for fault in state.snapshot.status.faults if fault.active} if state.snapshot else set()
    conditions = dict(_robot_notes(preview)) if preview else {}
    if state.outdated(now_s):
        # They may be over by now.
        conditions = {key: replace(note, style=SeverityStyle.QUIET) for key, note in conditions.items()}
    return Controls(
        enabled=preview is not None and state.link.state is LinkState.CONNECTED and not pending,
        on=on,
        profile=_profile(preview, None if on else selected),
        mark=current.value.upper(),
        style=PREVIEW_STYLES[current],
        summary=_summary(preview) if preview and current is not PreviewState.UNKNOWN else "",
        answers=tuple(_request_notes(state.request, now_s)),
        conditions=tuple(conditions.values()),
        beside_faults=tuple(note for fault, note in conditions.items() if fault not in said),
        camera="" if on else selected_camera,
        cameras=preview.cameras if preview else (),
        wanted_camera=_wanted_camera(preview, "" if on else selected_camera),
    )


def _profile(preview: PreviewStatus | None, selected: PreviewProfile | None) -> PreviewProfile:
    if selected is not None:
        return selected
    if preview is None or preview.profile is PreviewProfile.UNKNOWN:
        return PreviewProfile.BALANCED
    return preview.profile


def _wanted_camera(preview: PreviewStatus | None, selected: str) -> str:
    return selected or (preview.wanted_camera if preview else "")


def _summary(preview: PreviewStatus) -> str:
    encoder, video = preview.encoder, preview.video
    return joined(
        preview.live_camera.name if preview.live_camera and len(preview.cameras) > 1 else "",
        f"{video.width_px}x{video.height_px} at {video.fps:g} fps" if video else "",
        encoder.name if encoder else "",
        "in hardware" if encoder and encoder.hardware else "",
    )


def _request_notes(request: PreviewRequest | None, now_s: float) -> Iterator[Note]:
    if request is None:
        return
    outcome = request.outcome
    if outcome is None:
        yield Note("Waiting for the robot ...", SeverityStyle.QUIET)
    elif isinstance(outcome, GatewayError):
        yield Note(f"Request failed: {outcome}", SeverityStyle.BAD)
    elif not outcome.accepted:
        yield Note(f"The robot refused: {outcome.message}", SeverityStyle.BAD)
    elif outcome.preview.state is not PreviewState.FAULTED and now_s - request.ended_s < SUCCESS_SHOWN_S:
        # The reason of a fault is the robot's own note.
        yield Note(outcome.message, SeverityStyle.QUIET)


def _robot_notes(preview: PreviewStatus) -> Iterator[tuple[str, Note]]:
    """Yields the robot's own messages, each with the ID of the fault that says the same."""
    if preview.last_error:
        faulted = preview.state is PreviewState.FAULTED
        yield (
            "preview.faulted",
            Note(preview.last_error, SeverityStyle.BAD if faulted else SeverityStyle.WARNING),
        )
    elif not preview.service_reachable:
        unreachable = "The preview service on the robot does not answer the gateway"
        yield "preview.unreachable", Note(unreachable, SeverityStyle.WARNING)
    wanted = preview.camera(preview.wanted_camera)
    if wanted and wanted.state is CameraState.FAILED and preview.state is PreviewState.RUNNING:
        live = preview.live_camera
        instead = f"; {live.name} is shown" if live else ""
        text = f"Camera {wanted.name} does not work{instead}: {wanted.error}"
        yield f"preview.camera.{wanted.name}", Note(text, SeverityStyle.WARNING)
    if preview.encoder and preview.encoder.fallback_reason:
        text = f"Preferred {preview.encoder.wanted}: {preview.encoder.fallback_reason}"
        yield "preview.fallback", Note(text, SeverityStyle.WARNING)
    if preview.bitrate_reason:
        yield "", Note(f"Bit rate: {preview.bitrate_reason}", SeverityStyle.WARNING)
