"""Rules of the preview: requests, adoption, when a request is settled, and the view for clients."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from gateway.links.preview.counters import CounterTotals
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.reconciler import Reconciler
from gateway.status.preview import CameraState, PreviewState, PreviewView, Profile, camera_called
from gateway.status.values import Received

PreviewReconciler = Reconciler[PreviewSpec, PreviewReport, PreviewView]

_ENABLED: Final = frozenset({PreviewState.STARTING, PreviewState.RUNNING, PreviewState.FAULTED})
"""States of a service that has applied an enabled preview."""
_UNREACHABLE: Final = (
    "preview service unreachable ({}). Start or restart it; the gateway reconnects by itself"
)


class PreviewModel:
    """A Model of the preview.

    Args:
        encrypts: whether the stream of a listener at this address has a passphrase.
        new_passphrase: makes one per session.
    """

    initial: Final = PreviewSpec()

    def __init__(self, encrypts: Callable[[str], bool], new_passphrase: Callable[[], str]) -> None:
        self._encrypts = encrypts
        self._new_passphrase = new_passphrase
        self._totals = CounterTotals()
        self._state = PreviewState.DISABLED

    def adopt(self, spec: PreviewSpec, report: PreviewReport) -> tuple[PreviewSpec, bool]:
        """Takes the running preview over; applied again unless it is plain, as its passphrase is unknown."""
        enabled = report.state in _ENABLED
        # Before its first request the service reports its default profile, which no operator chose.
        chosen = report.profile if report.applied_revision else None
        spec = replace(spec, enabled=enabled, profile=chosen or spec.profile, camera=report.wanted_camera)
        plain = report.stream is not None and not report.stream.encrypted
        return spec, enabled and not plain

    def adapt(self, spec: PreviewSpec, report: PreviewReport) -> PreviewSpec:
        """Gives an enabled preview a passphrase, or none, depending on where its listener is reached.

        A camera that the service does not have, because its configuration has changed, is wanted no more.
        """
        if report.cameras and spec.camera and camera_called(spec.camera, report.cameras) is None:
            spec = replace(spec, camera="")
        address = report.listener.address if report.listener else ""
        encrypted = spec.enabled and self._encrypts(address)
        if encrypted == bool(spec.passphrase):
            return spec
        return replace(spec, passphrase=self._new_passphrase() if encrypted else "")

    def take_report(self, spec: PreviewSpec, report: PreviewReport, *, reapplying: bool) -> None:
        """Adds the counters to the totals."""
        if reapplying and spec.enabled:
            self._totals.next_start_is_restart()
        self._totals.take(report.instance_id, report.counters)

    def settled(self, spec: PreviewSpec, report: PreviewReport) -> bool:
        """A switch of profile or camera is settled when the stream has it, or the camera has failed."""
        if not spec.enabled:
            return report.state is PreviewState.DISABLED
        if report.state is PreviewState.RUNNING:
            wanted = camera_called(spec.camera, report.cameras)
            shown = wanted is None or wanted.state in {CameraState.LIVE, CameraState.FAILED}
            return shown and _profile_in_force(spec, report) is spec.profile
        return report.state is PreviewState.FAULTED

    def take_change(self, reconciler: PreviewReconciler) -> None:
        """Counts a fault that the gateway has found, not the service."""
        state, _ = _state(reconciler)
        found_here = reconciler.error is not None or reconciler.refusal is not None
        if found_here and state is PreviewState.FAULTED and self._state is not state:
            self._totals.add_fault()
        self._state = state

    def view(self, reconciler: PreviewReconciler) -> PreviewView:
        """Returns the view; a pipeline is in it only while the service is reachable."""
        spec, last, current = reconciler.desired.spec, reconciler.report, _current(reconciler)
        state, last_error = _state(reconciler)
        measured = last.value.measurement if last and state is not PreviewState.DISABLED else None
        return PreviewView(
            state=state,
            profile=_profile_in_force(spec, current),
            last_error=last_error,
            service_reachable=current is not None,
            listener=last.value.listener if last else None,
            stream=current.stream if current else None,
            encoder=current.encoder if current else None,
            # The newest figures; while the service is unreachable they stay and grow stale.
            measured=Received(measured, last.at_s) if last and measured else None,
            counters=self._totals.total,
            passphrase=spec.passphrase,
            wanted_camera=current.wanted_camera if current else "",
            cameras=current.cameras if current else (),
        )


def _current(reconciler: PreviewReconciler) -> PreviewReport | None:
    """Returns the newest report while the service is reachable."""
    return reconciler.report.value if reconciler.report and reconciler.error is None else None


def _state(reconciler: PreviewReconciler) -> tuple[PreviewState, str]:
    """Returns the state and the last error."""
    enabled, current = reconciler.desired.spec.enabled, _current(reconciler)
    if current is None and enabled:
        return PreviewState.FAULTED, _UNREACHABLE.format(reconciler.error)
    if current is None:
        return PreviewState.DISABLED, ""
    if reconciler.refusal is not None:
        return PreviewState.FAULTED, f"preview service refused the request: {reconciler.refusal}"
    if current.state is PreviewState.DISABLED and enabled and reconciler.pending():
        return PreviewState.STARTING, ""  # About to be applied.
    return current.state, "" if current.state is PreviewState.RUNNING else current.last_error


def _profile_in_force(spec: PreviewSpec, report: PreviewReport | None) -> Profile | None:
    return (report.profile if report and report.stream else None) or spec.profile
