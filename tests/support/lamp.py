"""A lamp: the smallest service that a link can have, in memory. Its desired state is a brightness."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace

from gateway.links.link import RefusedError
from gateway.links.reconciler import Desired, Reconciler
from gateway.links.watch import LinkLostError

SIGN_OF_LIFE_S = 0.05
BRIGHTEST = 100


@dataclass(frozen=True)
class LampSpec:
    percent: int = 0


@dataclass(frozen=True)
class LampReport:
    instance_id: str
    applied_revision: int = 0
    percent: int = 0


@dataclass(frozen=True)
class LampView:
    reachable: bool
    percent: int
    error: str


class LampModel:
    """A Model with nothing particular about it."""

    initial = LampSpec()

    def adopt(self, spec: LampSpec, report: LampReport) -> tuple[LampSpec, bool]:  # noqa: ARG002  # the protocol's
        return LampSpec(report.percent), False

    def adapt(self, spec: LampSpec, report: LampReport) -> LampSpec:  # noqa: ARG002  # the protocol's
        return spec

    def take_report(self, spec: LampSpec, report: LampReport, *, reapplying: bool) -> None:
        pass

    def settled(self, spec: LampSpec, report: LampReport) -> bool:
        return report.percent == spec.percent

    def take_change(self, reconciler: Reconciler[LampSpec, LampReport, LampView]) -> None:
        pass

    def view(self, reconciler: Reconciler[LampSpec, LampReport, LampView]) -> LampView:
        percent = reconciler.report.value.percent if reconciler.report else 0
        return LampView(reconciler.error is None, percent, reconciler.error or reconciler.refusal or "")


class LampService:
    """One process of the service: the ServiceClient of every connection to it.

    Attributes:
        report: its actual state.
        applied: every desired state that it was sent.
        thawed: while it is not set, no call is answered.
        reports_end: has the next stream of reports end after its first message.
    """

    def __init__(self, instance_id: str) -> None:
        self.report = LampReport(instance_id)
        self.applied: list[Desired[LampSpec]] = []
        self.thawed = asyncio.Event()
        self.thawed.set()
        self.reports_end = False
        self.gone = False

    async def reports(self) -> AsyncIterator[LampReport]:
        while True:
            await self._answering()
            yield self.report
            if self.reports_end:
                self.reports_end = False
                return
            await asyncio.sleep(SIGN_OF_LIFE_S)

    async def apply(self, desired: Desired[LampSpec]) -> LampReport:
        await self._answering()
        self.applied.append(desired)
        if desired.spec.percent > BRIGHTEST:
            raise RefusedError("too bright")
        self.report = replace(self.report, applied_revision=desired.revision, percent=desired.spec.percent)
        return self.report

    async def _answering(self) -> None:
        await self.thawed.wait()
        if self.gone:
            raise LinkLostError("the process has ended")


class LampConnector:
    """Connects to the process that runs at the moment.

    Attributes:
        open: connections now.
    """

    def __init__(self) -> None:
        self.process: LampService | None = None
        self.open = 0

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[LampService]:
        if self.process is None:
            raise LinkLostError("no process runs")
        self.open += 1
        try:
            yield self.process
        finally:
            self.open -= 1
