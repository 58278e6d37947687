"""Answers to operators who switch the preview."""

import logging
from dataclasses import dataclass, replace
from typing import Final

from gateway.links.link import ServiceLink
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.status.preview import PreviewState, PreviewView, Profile

_log = logging.getLogger(__name__)

PreviewLink = ServiceLink[PreviewSpec, PreviewReport, PreviewView]
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

    async def set_mode(self, *, enabled: bool, profile: Profile | None, remaining_s: float | None) -> str:
        """Requests the mode, unless it already is the desired one, and waits until that settles.

        Args:
            enabled: whether the preview shall run.
            profile: None keeps the current one.
            remaining_s: until the caller's deadline; None without one.

        Returns:
            The result, for people. Programs find it in the link's view.
        """
        desired = self.link.desired
        spec, state = desired.spec, self.link.view.state
        same = spec.enabled == enabled and (not enabled or profile in {None, spec.profile})
        if same and state is PreviewState.RUNNING and self.link.settled(desired):
            return f"preview is already running, {spec.profile_name}; nothing changed"
        # The same request again makes a faulted preview retry at once.
        if not same or (enabled and state is PreviewState.FAULTED):
            desired = self.link.request(spec.switched(enabled=enabled, profile=profile))
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


def _result(spec: PreviewSpec, view: PreviewView) -> str:
    match spec.enabled, view.state:
        case True, PreviewState.RUNNING:
            return f"preview is running, {spec.profile_name}"
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
