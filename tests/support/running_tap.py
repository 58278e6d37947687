"""A camera tap for a test: the real program, in the ROS domain of the environment."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from common.errors import UserError
from tap.client import observed_state
from tests.support.restartable_program import RestartableProgram
from tests.support.waiting import wait_until

PATIENCE_S = 20.0


class RunningTap(RestartableProgram):
    """The program as a process.

    Args:
        directory: for its configuration, socket and log.
        settings: keys of its configuration besides the socket.
    """

    name = "tap"
    end_within_s = PATIENCE_S
    process: subprocess.Popen[bytes]

    def __init__(self, directory: Path, **settings: Any) -> None:
        self.directory = directory
        self._settings = {"socket": str(self.socket), **settings}
        self._start()

    def __enter__(self) -> Self:
        self.serves()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.end(failed=kind is not None)

    def serves(self) -> None:
        """Waits until it serves."""
        wait_until(lambda: self._answers() or self.process.poll() is not None, "the tap serves", PATIENCE_S)
        self.assert_alive()

    def state(self) -> dict[str, Any]:
        """Its state."""
        return observed_state(self.socket)

    def wait_for(self, holds: Callable[[dict[str, Any]], object], what: str) -> dict[str, Any]:
        """Waits until a condition of its state holds."""

        def held() -> dict[str, Any] | None:
            state = self.state()
            return state if holds(state) else None

        return wait_until(held, f"{what}; last: {json.dumps(self.state())}", PATIENCE_S)

    def start_again(self) -> None:
        """Starts it after its end, as a supervisor does."""
        assert self.process.poll() is not None
        self._start()
        self.serves()

    def _answers(self) -> bool:
        try:
            self.state()
        except UserError:
            return False
        return True

    def _start(self) -> None:
        self.spawn((sys.executable, "-m", "tap.cli"), self._settings)
