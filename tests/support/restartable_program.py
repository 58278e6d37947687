"""A program of the robot as a process of its own, which may be killed and started again."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

import psutil

from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[2]


class RestartableProgram:
    """The part of such a program that all share.

    Attributes:
        name: of its files.
        end_within_s: how long its end may take.
        directory: for its configuration, socket and log.
        process: the newest one; None before the first start.
    """

    name: ClassVar[str]
    end_within_s: ClassVar[float]
    directory: Path
    process: subprocess.Popen[bytes] | None

    @property
    def socket(self) -> Path:
        return self.directory / f"{self.name}.sock"

    @property
    def log(self) -> Path:
        return self.directory / f"{self.name}.log"

    @property
    def pid(self) -> int:
        """Of the newest process."""
        assert self.process
        return self.process.pid

    def spawn(
        self,
        command: Sequence[str],
        settings: Mapping[str, Any],
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Starts it.

        Args:
            command: without the configuration.
            settings: of the configuration.
            environment: variables besides those of this process.
        """
        config = self.directory / f"{self.name}.yaml"
        config.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [*command, "serve", "--config", str(config)],
                cwd=_ROOT,
                env=os.environ | dict(environment or {}),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def kill(self) -> None:
        """Ends it without warning."""
        assert self.process
        self.process.kill()
        self.process.wait()

    def freeze(self) -> None:
        """Stops it without ending it: its connections stay open and silent."""
        process = psutil.Process(self.pid)
        process.suspend()
        # Its threads end what they are at.
        wait_until(lambda: process.status() == psutil.STATUS_STOPPED, f"{self.name} stands still")

    def thaw(self) -> None:
        """Lets it go on."""
        psutil.Process(self.pid).resume()

    def stop(self) -> int:
        """Ends it as an operator would; returns its exit code."""
        assert self.process
        self.process.terminate()
        try:
            return self.process.wait(self.end_within_s)
        except subprocess.TimeoutExpired:
            self.kill()
            raise

    def end(self, *, failed: bool) -> None:
        """The same; after a failure its log is on standard error."""
        try:
            self.stop()
        finally:
            if failed:
                sys.stderr.write(self.log.read_text(encoding="utf-8"))

    def descriptors(self) -> int:
        """Returns how many file descriptors it has."""
        return len(list(Path(f"/proc/{self.pid}/fd").iterdir()))

    def threads(self) -> int:
        """Returns how many threads it has."""
        return len(list(Path(f"/proc/{self.pid}/task").iterdir()))

    def assert_alive(self) -> None:
        """Fails, with the end of its log, if it has ended."""
        assert self.process
        assert self.process.poll() is None, self.log.read_text(encoding="utf-8")[-2000:]
