"""robotctl as a user types it: its exit code and what it printed.

`robotctl` runs the command line in this process, which takes a tenth of the time; `robotctl_process` runs the
installed program. Each file of tests that uses the first has a test that uses the second or `ROBOTCTL`.
"""

import io
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

from common.errors import ExitCode
from console.cli.run import exit_code
from console.client import ClientOptions, aio
from tests.support.patient import PATIENT

ROBOTCTL = Path(sys.executable).parent / "robotctl"
ENDS_WITHIN_S = 60.0
_in_use = threading.Lock()
"""Of this process's command line, environment and output."""


def environment(**extra: str) -> dict[str, str]:
    """This one without settings and known robots that would change how robotctl behaves."""
    dropped = {"ROBOTCTL_TARGET", "ROBOTCTL_ROBOT", "NO_COLOR", "FORCE_COLOR", "COLUMNS", "LINES", "TERM"}
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return kept | {"XDG_CONFIG_HOME": "/nonexistent", "ROBOTCTL_DISCOVERY": "127.0.0.1"} | extra


def robotctl(*words: str, **extra: str) -> "subprocess.CompletedProcess[str]":
    """Runs the command line to its end, output captured; `extra` goes into its environment.

    It waits for a robot longer than the installed program, unless the test has replaced its client's options:
    a stall of the machine then ends no call.

    Raises:
        RuntimeError: another thread does: one of them has to be a process.
    """
    if vars(aio)["ClientOptions"] is not ClientOptions:
        return robotctl_in_time(*words, **extra)
    with mock.patch.object(aio, "ClientOptions", return_value=PATIENT):
        return robotctl_in_time(*words, **extra)


def robotctl_in_time(*words: str, **extra: str) -> "subprocess.CompletedProcess[str]":
    """As `robotctl`, with the deadlines of the installed program."""
    out, err = _pipe(), _pipe()
    with (
        _alone(),
        mock.patch.object(sys, "argv", [str(ROBOTCTL), *words]),
        _only_for_python(environment(**extra)),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        code = exit_code()
    return subprocess.CompletedProcess([ROBOTCTL, *words], code, _text(out), _text(err))


@contextmanager
def _only_for_python(variables: dict[str, str]) -> Iterator[None]:
    """Replaces `os.environ`, and leaves the environment that C code reads as it is.

    setenv(3) moves the table while gRPC's threads read it (c-ares asks for LOCALDOMAIN for each name it
    resolves): replacing all variables for every call crashed one call in 5000.
    """
    with (
        mock.patch.object(os, "putenv"),
        mock.patch.object(os, "unsetenv"),
        mock.patch.dict(os.environ, variables, clear=True),
    ):
        yield


@contextmanager
def _alone() -> Iterator[None]:
    if not _in_use.acquire(blocking=False):
        raise RuntimeError("robotctl runs in this process already: use robotctl_process")
    try:
        yield
    finally:
        _in_use.release()


def robotctl_process(*words: str, **extra: str) -> "subprocess.CompletedProcess[str]":
    """Runs the installed program to its end, in pipes; `extra` goes into its environment."""
    return subprocess.run(
        [ROBOTCTL, *words],
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(**extra),
        check=False,
    )


def viewed(*words: str, **extra: str) -> "subprocess.CompletedProcess[str]":
    """`robotctl_process` of a robot that is there and may be viewed: the first call may find it too late.

    A viewer without a window ends when its first connection is not made in time, as on a machine that has
    stood still: then it is started once more.
    """
    done = robotctl_process(*words, **extra)
    return robotctl_process(*words, **extra) if done.returncode == ExitCode.UNREACHABLE else done


def only_line(text: str) -> str:
    """The one line there is."""
    (line,) = text.splitlines()
    return line


def _pipe() -> io.TextIOWrapper:
    """A text stream over bytes, as standard output is when it leads into a pipe."""
    return io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)


def _text(pipe: io.TextIOWrapper) -> str:
    pipe.seek(0)
    return pipe.read()
