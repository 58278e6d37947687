"""A receiver as a program of its own, to be killed: `robot-bridge hub receiver`."""

import asyncio
import json
import subprocess
import sys
from pathlib import Path

from common.healthcheck import state_of
from hub.receiver.config import ReceiverSettings
from tests.support.eventually import eventually

COMMAND = Path(sys.executable).parent / "robot-bridge"
_UP_WITHIN_S = 60.0


class ReceiverProgram:
    """Starts, is killed, and starts again.

    Args:
        settings: of the receiver.
        directory: for its configuration and its log.

    Attributes:
        kills: how often it was killed.
    """

    def __init__(self, settings: ReceiverSettings, directory: Path) -> None:
        self._settings = settings
        self._config = directory / f"{settings.socket.stem}.yaml"
        # JSON is YAML, too.
        content = settings.model_dump(mode="json", exclude_none=True)
        self._config.write_text(json.dumps(content), encoding="utf-8")
        self._log = self._config.with_suffix(".log")
        self._process: subprocess.Popen[bytes] | None = None
        self.kills = 0

    async def start(self) -> None:
        """Returns when it serves."""
        # A killed one leaves its socket behind.
        self._process = self._started()
        await eventually(self._state, lambda now: now == "SERVING", "the receiver serves", _UP_WITHIN_S)

    def _started(self) -> subprocess.Popen[bytes]:
        command = [str(COMMAND), "hub", "receiver", "--config", str(self._config)]
        with self._log.open("ab") as log:
            return subprocess.Popen(command, stdout=log, stderr=log)

    def kill(self) -> None:
        """Kills it at once, wherever it is."""
        assert self._process
        assert self._process.poll() is None, self.log()[-2000:]
        self._process.kill()
        self._process.wait()
        self.kills += 1

    def end(self) -> None:
        """Kills it if it runs; does nothing otherwise."""
        if self._process and self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def log(self) -> str:
        """Returns what it has logged in all its lives."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    async def _state(self) -> str:
        assert self._process
        assert self._process.poll() is None, self.log()[-2000:]
        return await asyncio.to_thread(state_of, f"unix:{self._settings.socket}", "receiver")
