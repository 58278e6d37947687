"""The four programs: started, watched, and stopped in reverse order whatever happens."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self, TypeVar

from common.errors import UserError
from demo_program.ground import Ground
from demo_program.interruption import SIGNALS, Interruption

_BIN: Final = Path(sys.executable).parent
SPEED_MPS: Final = 0.15
"""Of the robot by itself: wheels of its base that are clamped would bend its circle."""
_STOP_WITHIN_S: Final = 8.0
_POLL_S: Final = 0.05

AnswerT = TypeVar("AnswerT")


class ProgramError(UserError):
    """One of the programs ended by itself, or would not end.

    Args:
        program: which.
        what: what happened.
    """

    def __init__(self, program: str, what: str) -> None:
        super().__init__(f"{program} {what}", "The end of its log says why")
        self.program = program


class Programs:
    """Simulated robot, preview, drive program, gateway; running inside the `with` block, gone after it.

    Args:
        ground: where they run.
        interruption: looked at while something is waited for.
    """

    def __init__(self, ground: Ground, interruption: Interruption) -> None:
        self._ground = ground
        self.interruption = interruption
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._stops = ExitStack()

    def __enter__(self) -> Self:
        directory = self._ground.directory
        try:
            robot = ("run", "--base", f"speed_mps={SPEED_MPS}", "--control", str(self._ground.control_socket))
            self._start("simrobot", *robot)
            self._start("robot-preview", "serve", "--config", str(directory / "preview.yaml"))
            self._start("robot-drive", "serve", "--config", str(directory / "drive.yaml"))
            self._start("robot-gateway", "serve", "--config", str(directory / "gateway.yaml"))
        except BaseException:
            self._stop_after_trouble()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is None:
            self.stop()
        else:
            self._stop_after_trouble()

    def stop(self) -> None:
        """Ends all, the last one first. Calling it again does nothing.

        Raises:
            ProgramError: one did not end in good order; it is gone all the same.
        """
        with _undisturbed():
            self._stops.close()

    def pids(self) -> dict[str, int]:
        """The programs' process ids."""
        return {name: process.pid for name, process in self._running.items()}

    def check_alive(self) -> None:
        """Raises ProgramError when one has ended by itself, KeyboardInterrupt when all shall end."""
        self.interruption.raise_if_asked()
        for name, process in self._running.items():
            code = process.poll()
            if code is not None:
                raise ProgramError(name, _end_in_words(code))

    def wait_until(
        self, look: Callable[[], AnswerT | None], within_s: float, what: str | Callable[[], str]
    ) -> AnswerT:
        """Looks until there is something to see.

        Args:
            look: gives None while there is nothing.
            within_s: how long to try.
            what: what is waited for, or a function that says what was seen instead.

        Raises:
            UserError: time is up, or a program ended.
        """
        until_s = time.monotonic() + within_s
        while (answer := look()) is None:
            self.check_alive()
            if time.monotonic() > until_s:
                seen = what if isinstance(what, str) else what()
                raise UserError(f"not within {within_s:g} s: {seen}")
            time.sleep(_POLL_S)
        return answer

    def _stop_after_trouble(self) -> None:
        # Why the demo ends counts more than how a program takes its end.
        with suppress(ProgramError):
            self.stop()

    def _start(self, name: str, *arguments: str) -> None:
        # Should this process be killed outright, the kernel ends the programs for it.
        command = ["setpriv", "--pdeathsig", "TERM", str(_BIN / name), *arguments]
        with self._ground.log_of(name).open("wb") as log:
            process = subprocess.Popen(  # noqa: S603  # our own programs and arguments
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._ground.environment(),
                # Ctrl-C on the terminal reaches this process only, which stops them in order.
                start_new_session=True,
            )
        self._running[name] = process
        self._stops.callback(self._stop_one, name, process)

    def _stop_one(self, name: str, process: subprocess.Popen[bytes]) -> None:
        ended_before = process.poll() is not None
        process.terminate()
        late = False
        try:
            process.wait(_STOP_WITHIN_S)
        except subprocess.TimeoutExpired:
            late = True
        # What the program may have left of its own children goes with it.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        del self._running[name]
        if late:
            raise ProgramError(name, f"did not end within {_STOP_WITHIN_S:g} s and was killed")
        if process.returncode and not ended_before:
            raise ProgramError(name, _end_in_words(process.returncode))


def _end_in_words(code: int) -> str:
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


class _undisturbed:  # noqa: N801 - reads as what it is in `with _undisturbed()`
    """Keeps an impatient second Ctrl-C from leaving programs behind: ending is bounded anyway."""

    def __enter__(self) -> None:
        self._before = {number: signal.signal(number, signal.SIG_IGN) for number in SIGNALS}

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
