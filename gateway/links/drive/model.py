"""Rules of driving: what is desired at the start, when a request is settled, and the view for clients."""

from gateway.links.drive.state import DriveReport, DriveSpec
from gateway.links.reconciler import Reconciler
from gateway.status.teleop import DrivePhase, DriveView

DriveReconciler = Reconciler[DriveSpec, DriveReport, DriveView]


class DriveModel:
    """A Model of the drive program.

    Args:
        enabled_at_start: whether driving is enabled before the first request.
    """

    def __init__(self, *, enabled_at_start: bool) -> None:
        self.initial = DriveSpec(enabled=enabled_at_start)

    def adopt(self, spec: DriveSpec, report: DriveReport) -> tuple[DriveSpec, bool]:
        """Keeps driving disabled that an earlier gateway had disabled; otherwise the configuration counts."""
        if report.applied_revision and not _may_be_driven(report):
            return DriveSpec(enabled=False), False
        return spec, True

    def adapt(self, spec: DriveSpec, _report: DriveReport) -> DriveSpec:
        """Returns the spec: nothing of it depends on the drive program's setup."""
        return spec

    def take_report(self, _spec: DriveSpec, _report: DriveReport, *, reapplying: bool) -> None:
        """No-op: the drive program counts for itself."""

    def settled(self, _spec: DriveSpec, _report: DriveReport) -> bool:
        """What is applied is reached: a disabled robot publishes zeros at once."""
        return True

    def take_change(self, _reconciler: DriveReconciler) -> None:
        """No-op."""

    def view(self, reconciler: DriveReconciler) -> DriveView:
        """Returns the view."""
        last = reconciler.report.value if reconciler.report else None
        return DriveView(
            enabled=reconciler.desired.spec.enabled,
            applied=reconciler.error is None and reconciler.pending() is None,
            error=reconciler.error or reconciler.refusal or "",
            actual=last,
        )


def _may_be_driven(report: DriveReport) -> bool:
    # Of an older drive program the phase is all there is; a stop hides there that driving is disabled.
    return report.phase is not DrivePhase.DISABLED if report.enabled is None else report.enabled
