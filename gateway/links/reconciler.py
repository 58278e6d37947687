"""Decides what to apply to a service, from the desired state and its reports. Pure; one owner.

The pattern is a Kubernetes controller's: level-triggered; `applied_revision` is its `observedGeneration`.
"""

from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

from gateway.status.values import Received


class Report(Protocol):
    """The part of a report that every service sends."""

    @property
    def instance_id(self) -> str:
        """Names the process of the service."""

    @property
    def applied_revision(self) -> int:
        """Newest revision that this process has applied; 0 if none."""


SpecT = TypeVar("SpecT")
ReportT = TypeVar("ReportT", bound=Report)
ViewT = TypeVar("ViewT")


@dataclass(frozen=True, slots=True)
class Desired(Generic[SpecT]):
    """Desired state of a service. Two with the same revision are the same.

    Attributes:
        request_id: of the request that caused it, for the logs; empty if none did.
    """

    revision: int
    spec: SpecT
    request_id: str = ""


class Model(Protocol[SpecT, ReportT, ViewT]):
    """What differs from service to service."""

    @property
    def initial(self) -> SpecT:
        """Desired before the first request and the first report."""

    def adopt(self, spec: SpecT, report: ReportT) -> tuple[SpecT, bool]:
        """Returns the spec that continues what the service does, and whether it must be applied for that."""

    def adapt(self, spec: SpecT, report: ReportT) -> SpecT:
        """Returns the spec with what depends on the service's setup; called with each request and report."""

    def take_report(self, spec: SpecT, report: ReportT, *, reapplying: bool) -> None:
        """Called with each report; `reapplying` if the service has lost a spec that had been applied."""

    def settled(self, spec: SpecT, report: ReportT) -> bool:
        """Whether the service, which has applied the spec, has reached it or failed to."""

    def take_change(self, reconciler: "Reconciler[SpecT, ReportT, ViewT]") -> None:
        """Called after each change, before `view`."""

    def view(self, reconciler: "Reconciler[SpecT, ReportT, ViewT]") -> ViewT:
        """Returns what clients may know; changes nothing."""


class Reconciler(Generic[SpecT, ReportT, ViewT]):
    """State of one link.

    Args:
        first_revision: larger than any that an earlier gateway of this boot assigned.
        model: the rules of this service.

    Attributes:
        desired: newest desired state.
        report: last report, kept when the connection is lost; None before the first.
        error: why the service is unreachable; None while it is reachable.
        view: what clients may know. A change of anything makes a new object, and nothing else does, so that
            caches compare by identity.
    """

    def __init__(self, first_revision: int, model: Model[SpecT, ReportT, ViewT]) -> None:
        self._model = model
        self.desired = Desired(first_revision, model.initial)
        self.report: Received[ReportT] | None = None
        self.error: str | None = "not connected yet"
        self._owned = False  # Requested from this gateway, or adopted by it.
        self._applied_once = False  # By any process of the service, since the last request.
        self._attempted = False  # At least one connection attempt has failed since the last request.
        self._refusal: tuple[str, int, str] | None = None  # Instance, the revision it refused, and why.
        self.view = model.view(self)

    @property
    def refusal(self) -> str | None:
        """Why the present process refuses the present desired state; None if it does not."""
        if self.report is None or self._refusal is None:
            return None
        instance_id, revision, reason = self._refusal
        current = (self.report.value.instance_id, self.desired.revision)
        return reason if (instance_id, revision) == current else None

    def request(self, spec: SpecT, request_id: str = "") -> Desired[SpecT]:
        """Replaces the desired state; returns it with its revision."""
        revision = max(self.desired.revision, self._applied_revision()) + 1
        if self.report:
            spec = self._model.adapt(spec, self.report.value)
        self.desired = Desired(revision, spec, request_id)
        self._owned, self._applied_once, self._attempted = True, False, False
        self._update_view()
        return self.desired

    def take_report(self, report: ReportT, now_s: float) -> bool:
        """Records a report of the service; returns whether it was unreachable before."""
        if self._is_outdated(report):
            return False
        regained = self.error is not None
        self.error, self.report = None, Received(report, now_s)
        if not self._owned:
            self._adopt(report)
        elif report.applied_revision > self.desired.revision:
            self.desired = replace(self.desired, revision=report.applied_revision + 1)
        self._adapt(report)
        in_force = report.applied_revision == self.desired.revision
        self._applied_once = self._applied_once or in_force
        self._model.take_report(self.desired.spec, report, reapplying=self._applied_once and not in_force)
        self._update_view()
        return regained

    def take_refusal(self, desired: Desired[SpecT], reason: str) -> None:
        """Records that the service refuses `desired`: repeating it to the same process is of no use."""
        if self.report:
            self._refusal = (self.report.value.instance_id, desired.revision, reason)
            self._update_view()

    def take_loss(self, error: str) -> bool:
        """Records a lost connection or a failed attempt; returns whether the service was reachable before."""
        was_reachable = self.error is None
        self.error, self._attempted = error, True
        self._update_view()
        return was_reachable

    def pending(self) -> Desired[SpecT] | None:
        """Returns the desired state that must be applied; None if it is, or cannot be."""
        if self.error is not None or self.refusal is not None:
            return None
        return self.desired if self._applied_revision() != self.desired.revision else None

    def settled(self, desired: Desired[SpecT]) -> bool:
        """Whether `desired` was reached, failed or replaced, so that waiting longer is of no use."""
        if desired.revision != self.desired.revision or self.refusal is not None:
            return True
        if self.error is not None or self.report is None:
            return self._attempted
        report = self.report.value
        return report.applied_revision == desired.revision and self._model.settled(desired.spec, report)

    def _adopt(self, report: ReportT) -> None:
        """Continues what an earlier gateway had applied, at the first contact without a request before it."""
        spec, must_be_applied = self._model.adopt(self.desired.spec, report)
        revision = report.applied_revision
        self.desired = Desired(revision + 1 if must_be_applied else revision, spec)
        self._owned = True

    def _adapt(self, report: ReportT) -> None:
        """Adapts the desired state to a service that may have been set up differently before."""
        spec, revision = self._model.adapt(self.desired.spec, report), self.desired.revision
        if spec != self.desired.spec:
            # A service ignores another spec of a revision that it has applied. Otherwise the revision stays,
            # for those who wait until it settles.
            applied = report.applied_revision == revision
            self.desired = replace(self.desired, revision=revision + 1 if applied else revision, spec=spec)

    def _is_outdated(self, report: ReportT) -> bool:
        """Whether the reply to a request, which came by another call, has overtaken this report."""
        if self.report is None or self.error is not None:
            return False
        last = self.report.value
        return report.instance_id == last.instance_id and report.applied_revision < last.applied_revision

    def _applied_revision(self) -> int:
        return self.report.value.applied_revision if self.report else 0

    def _update_view(self) -> None:
        self._model.take_change(self)
        view = self._model.view(self)
        if view != self.view:
            self.view = view
