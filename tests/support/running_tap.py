"""A camera tap for a test: the real program, in the ROS domain of the environment."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml

from common.errors import UserError
from tap.client import observed_state
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[2]
PATIENCE_S = 20.0


class RunningTap:
    """The program as a process.

    Args:
        directory: for its configuration, socket and log.
        settings: keys of its configuration besides the socket.
    """

    def __init__(self, directory: Path, **settings: Any) -> None:
        self.socket = directory / "tap.sock"
        self.log = directory / "tap.log"
        self._config = directory / "tap.yaml"
        self._config.write_text(yaml.safe_dump({"socket": str(self.socket), **settings}), encoding="utf-8")
        self.process = self._spawn()

    def __enter__(self) -> Self:
        self.serves()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        try:
            self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise
        finally:
            if kind is not None:
                sys.stderr.write(self.log.read_text(encoding="utf-8"))

    def serves(self) -> None:
        """Waits until it serves."""
        wait_until(lambda: self._answers() or self.process.poll() is not None, "the tap serves", PATIENCE_S)
        assert self.process.poll() is None, self.log.read_text(encoding="utf-8")

    def state(self) -> dict[str, Any]:
        """Its state."""
        return observed_state(self.socket)

    def wait_for(self, holds: Callable[[dict[str, Any]], object], what: str) -> dict[str, Any]:
        """Waits until a condition of its state holds."""

        def held() -> dict[str, Any] | None:
            state = self.state()
            return state if holds(state) else None

        return wait_until(held, f"{what}; last: {json.dumps(self.state())}", PATIENCE_S)

    def descriptors(self) -> int:
        """How many file descriptors it has."""
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    def threads(self) -> int:
        """How many threads it has."""
        return len(list(Path(f"/proc/{self.process.pid}/task").iterdir()))

    def kill(self) -> None:
        """Kills it, so that it can't say anything any more."""
        self.process.kill()
        self.process.wait()

    def start_again(self) -> None:
        """Starts it after its end, as a supervisor does."""
        assert self.process.poll() is not None
        self.process = self._spawn()
        self.serves()

    def _answers(self) -> bool:
        try:
            self.state()
        except UserError:
            return False
        return True

    def _spawn(self) -> subprocess.Popen[bytes]:
        with self.log.open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "tap.cli", "serve", "--config", str(self._config)],
                cwd=ROOT,
                env=dict(os.environ),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
