"""Answers to operators who switch the preview."""

import logging
from dataclasses import dataclass, replace
from typing import Final

from common.errors import FieldViolation, InvalidRequestError
from gateway.links.link import ServiceLink
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.wire_values import printable
from gateway.status.preview import (
    Camera,
    CameraState,
    PreviewState,
    PreviewView,
    Profile,
    camera_called,
    live_camera,
)

_log = logging.getLogger(__name__)

PreviewLink = ServiceLink[PreviewSpec, PreviewReport, PreviewView]
LONGEST_CAMERA: Final = 64
"""Characters of a name that a refusal repeats."""
DEADLINE_MARGIN_S: Final = 0.2
"""The answer leaves this long before the caller's deadline, so that it still arrives."""


@dataclass(frozen=True, slots=True)
class PreviewControl:
    """Carries SetPreviewMode out.

    Attributes:
        settle_s: longest wait for a request to settle.
    """

    link: PreviewLink
    settle_s: float

    async def set_mode(
        self, *, enabled: bool, profile: Profile | None, remaining_s: float | None, camera: str = ""
    ) -> str:
        """Requests the mode, unless it already is the desired one, and waits until that settles.

        Args:
            enabled: whether the preview shall run.
            profile: None keeps the current one.
            remaining_s: until the caller's deadline; None without one.
            camera: to be shown; empty keeps the current one.

        Returns:
            The result, for people. Programs find it in the link's view.

        Raises:
            InvalidRequestError: there is no such camera.
        """
        _require(camera, self.link.view)
        desired = self.link.desired
        spec, state = desired.spec, self.link.view.state
        same = spec.enabled == enabled and (not enabled or profile in {None, spec.profile})
        same = same and camera in {"", self.link.view.wanted_camera}
        works = _failed_camera(self.link.view) is None
        if same and works and state is PreviewState.RUNNING and self.link.settled(desired):
            return f"preview is already running, {_described(spec, self.link.view)}; nothing changed"
        # The same request again makes a faulted preview, or a camera that has failed, be tried at once.
        if not same or (enabled and (state is PreviewState.FAULTED or not works)):
            desired = self.link.request(spec.switched(enabled=enabled, profile=profile, camera=camera))
        patience_s = self.settle_s
        if remaining_s is not None:
            patience_s = max(0.0, min(patience_s, remaining_s - DEADLINE_MARGIN_S))
        await self.link.wait_until_settled(desired, patience_s)
        if self.link.desired.revision != desired.revision:
            return f"replaced by a newer request: preview {self.link.desired.spec}"
        if self.link.refusal is not None:
            return f"preview service refused the request: {self.link.refusal}"
        return _result(desired.spec, self.link.view)

    def renew_passphrase(self) -> None:
        """Replaces the passphrase of a running session, which disconnects all viewers.

        Those who may still see the status find the new one there.
        """
        spec = self.link.desired.spec
        if spec.passphrase:
            _log.info("preview: a caller has lost access; the stream gets a new passphrase")
            self.link.request(replace(spec, passphrase=""))


def _require(camera: str, view: PreviewView) -> None:
    """Refuses a camera that the robot does not have, as far as its preview service has said which there are.

    Raises:
        InvalidRequestError: with the names.
    """
    if not camera or not view.service_reachable or camera_called(camera, view.cameras):
        return
    names = ", ".join(each.name for each in view.cameras)
    text = f"no camera is called '{printable(camera, LONGEST_CAMERA)}'; " + (
        f"this robot has: {names}"
        if names
        else "this robot's preview service is older than the choice of a camera: update it"
    )
    raise InvalidRequestError(text, (FieldViolation("camera", text),))


def _failed_camera(view: PreviewView) -> Camera | None:
    """Returns the wanted camera if it has failed."""
    wanted = camera_called(view.wanted_camera, view.cameras)
    return wanted if wanted and wanted.state is CameraState.FAILED else None


def _described(spec: PreviewSpec, view: PreviewView) -> str:
    """Returns the profile, and the camera where there is a choice."""
    live = live_camera(view.cameras) if len(view.cameras) > 1 else None
    return f"{spec.profile_name}, camera {live.name}" if live else spec.profile_name


def _running(spec: PreviewSpec, view: PreviewView) -> str:
    failed, live = _failed_camera(view), live_camera(view.cameras)
    if failed is None:
        return f"preview is running, {_described(spec, view)}"
    instead = f"; camera {live.name} is shown" if live else ""
    return f"preview is running, but camera {failed.name} does not work{instead}: {failed.error}"


def _result(spec: PreviewSpec, view: PreviewView) -> str:
    match spec.enabled, view.state:
        case True, PreviewState.RUNNING:
            return _running(spec, view)
        case True, PreviewState.FAULTED:
            return f"preview has failed and the robot keeps trying: {view.last_error}"
        case False, PreviewState.DISABLED if view.service_reachable:
            return "preview is off"
        case False, PreviewState.DISABLED:
            return "preview is off; its service is unreachable and gets the request when it is back"
        case False, PreviewState.FAULTED:
            return f"preview could not be turned off: {view.last_error}"
        case _:
            goal = "running" if spec.enabled else "off"
            return f"preview is not {goal} yet ({view.state.value}); check the status for progress"
