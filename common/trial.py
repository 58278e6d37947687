"""Trials: work that may crash or hang in a driver, in a child process with a deadline.

`run` starts `python -m common.trial_child`, which calls the function `main` of a module.
"""

import asyncio
import json
import os
import select
import signal
import sys
from contextlib import suppress
from typing import Any, Final

from common.deadline import within

_KILL_S: Final = 1.0
"""For the end of a killed child; a driver may keep it in the kernel for longer."""
_held: Final[dict[tuple[str, ...], int]] = {}
"""Process descriptors (pidfd_open(2)) of killed children that a driver keeps, by module and arguments."""
_MAX_OUTPUT_BYTES: Final = 64 * 1024


class TrialError(Exception):
    """A trial that gave no result, or a bad one; the text says why, for people.

    Attributes:
        passing: the cause may be the state of the machine, not what was tried: another trial may succeed.
    """

    def __init__(self, reason: str, *, passing: bool = False) -> None:
        super().__init__(reason)
        self.passing = passing


async def run(timeout_s: float, module: str, *arguments: str) -> dict[str, Any]:
    """Runs `module.main(*arguments)` in a child process and returns what it reports.

    Cancelling it kills the child; it does not take longer than a second more. While a driver keeps a killed
    child in the kernel, none is started for the same trial: it would hang, too, and stay as well.

    Args:
        timeout_s: deadline in seconds, start of the process included.
        module: full name.
        arguments: of its `main`.

    Raises:
        TrialError: the child reported an error, crashed, exceeded the deadline or could not be started.
    """
    what = (module, *arguments)
    if _is_held(what):
        raise TrialError("its last trial was killed and has not ended", passing=True)
    try:
        child = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "common.trial_child", str(os.getpid()), module, *arguments),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_MAX_OUTPUT_BYTES,
        )
    except OSError as error:
        raise TrialError(f"its trial can't be started: {error.strerror}", passing=True) from error
    output = None
    try:
        with suppress(TimeoutError):
            output = await within(timeout_s, _output(child))
    finally:
        await _kill(child, what)
    if output is None:
        raise TrialError(f"it hung: no result within {timeout_s:g} s", passing=True)
    return parse_result(output, child.returncode or 0)


async def _output(child: asyncio.subprocess.Process) -> bytes:
    """Returns what the child has printed, when it has ended.

    Raises:
        TrialError: it printed too much; it is killed then, and the rest is read away to free the pipe.
    """
    assert child.stdout is not None  # noqa: S101  # a pipe
    output = b""
    while chunk := await child.stdout.read(_MAX_OUTPUT_BYTES):
        if len(output) <= _MAX_OUTPUT_BYTES:
            output += chunk
        elif child.returncode is None:
            with suppress(ProcessLookupError):
                child.kill()
    await child.wait()
    if len(output) > _MAX_OUTPUT_BYTES:
        raise TrialError(f"its trial printed more than {_MAX_OUTPUT_BYTES // 1024} KiB")
    return output


async def _kill(child: asyncio.subprocess.Process, what: tuple[str, ...]) -> None:
    """Kills a child that still runs, and waits for its end for at most _KILL_S; notes one that is held."""
    if child.returncode is not None:
        return
    with suppress(ProcessLookupError):
        child.kill()
    try:
        await within(_KILL_S, child.wait())
    except TimeoutError:
        with suppress(OSError):  # It has just ended, or no descriptor is left: then it is not remembered.
            _held[what] = os.pidfd_open(child.pid)


def _is_held(what: tuple[str, ...]) -> bool:
    """Returns whether a killed child of this trial has still not ended; forgets those that have."""
    for key, handle in list(_held.items()):
        ended = select.poll()
        ended.register(handle, select.POLLIN)
        if ended.poll(0):
            os.close(_held.pop(key))
    return what in _held


def parse_result(output: bytes, code: int) -> dict[str, Any]:
    """Returns what a child has reported.

    Args:
        output: all that it printed.
        code: its exit code, negative for a signal.

    Raises:
        TrialError: it crashed, reported an error, or printed something else.
    """
    if code < 0:
        # SIGKILL comes from outside: from the kernel when memory is short.
        raise TrialError(f"it crashed when tried ({_signal_name(-code)})", passing=-code == signal.SIGKILL)
    try:
        result = dict(json.loads(output))
    except (ValueError, TypeError, RecursionError):
        raise TrialError(f"its trial ended with code {code} and without a result") from None
    if reason := result.get("error"):
        raise TrialError(str(reason))
    return result


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"  # a real-time one
