"""An operator who never stops asking: notes every answer, how long it took, and what came instead."""

import threading
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from console.client.blocking import GatewayClient
from console.client.errors import GatewayError
from console.client.results import PreviewState, SystemStatus
from tests.support.waiting import wait_until


@dataclass(frozen=True)
class Answer:
    """One status, when it came (wall clock, as the engine's times are) and how long it took."""

    at_s: float
    took_s: float
    status: SystemStatus


class Lookout:
    """Asks for the status every 20 ms until it is left."""

    def __init__(self, robot: GatewayClient) -> None:
        self._robot = robot
        self.answers: list[Answer] = []
        self.errors: list[GatewayError] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._ask, name="lookout")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(15)

    @property
    def slowest_s(self) -> float:
        """The longest wait for an answer."""
        return max(answer.took_s for answer in list(self.answers))

    def wait_for(self, state: PreviewState, since_s: float, within_s: float) -> Answer:
        """The first answer after `since_s` (wall clock) with this state of the preview."""

        def first() -> Answer | None:
            return next(
                (a for a in list(self.answers) if a.at_s >= since_s and a.status.preview.state is state), None
            )

        return wait_until(first, f"the preview is reported as {state.value}", within_s)

    def _ask(self) -> None:
        while not self._over.wait(0.02):
            began_s = time.monotonic()
            try:
                status = self._robot.status()
            except GatewayError as error:
                self.errors.append(error)
                continue
            self.answers.append(Answer(time.time(), time.monotonic() - began_s, status))
