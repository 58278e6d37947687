"""Entry points of programs: an asyncio loop that SIGINT and SIGTERM stop, and errors as one line."""

import asyncio
import ctypes
import resource
import signal
import sys
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any, Final, NoReturn

import typer
import uvloop

from common import heartbeat
from common.command_line import read_plainly, usage_error
from common.errors import ExitCode, UserError
from common.output import tolerate_encoding

_DESCRIPTORS: Final = 65_536
"""More than any program of the project can use."""
_M_ARENA_MAX: Final = -8
"""glibc, malloc.h."""
_ARENAS: Final = 2


def run_to_exit(work: Callable[[], None]) -> None:
    """Calls `work`; if it raises a `UserError`, prints it as one line and exits with its exit code."""
    tolerate_encoding()
    try:
        work()
    except UserError as error:
        end_with(error)


def run_command_line(app: typer.Typer, name: str) -> None:
    """Runs a program's command line and ends the process; every mistake is one line.

    Args:
        app: Of the program.
        name: Of the program.
    """
    command = typer.main.get_command(app)
    read_plainly(command)

    def work() -> None:
        try:
            code = command.main(prog_name=name, standalone_mode=False)
        except typer.TyperException as error:
            raise usage_error(error, name) from error
        except typer.Abort:
            code = ExitCode.FAILED
        sys.exit(code if isinstance(code, int) else ExitCode.DONE)

    run_to_exit(work)


def end_with(error: UserError) -> NoReturn:
    """Prints the error as one line on standard error and exits with its exit code."""
    print(f"error: {error}", file=sys.stderr)
    raise SystemExit(int(error.exit_code))


def run(main: Callable[[asyncio.Event], Coroutine[Any, Any, None]]) -> None:
    """Runs `main(stop)` on a new uvloop; the first SIGINT or SIGTERM sets `stop`, a second cancels `main`.

    `main` is expected to return soon after `stop` is set. Sends heartbeats to a supervisor that wants them,
    and notifies it of the first signal.
    """
    _raise_descriptor_limit()
    uvloop.run(_with_signals(main))


def bound_arenas() -> None:
    """Makes glibc serve all threads from two arenas, before there are other threads.

    By default there are up to eight for each core, and what is free in one serves no thread of another.
    Does nothing with another C library.
    """
    with suppress(AttributeError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _ARENAS)


def _raise_descriptor_limit() -> None:
    """Raises the soft limit (1024 by tradition) towards the hard one: each connection takes a descriptor."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, _DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


async def _with_signals(main: Callable[[asyncio.Event], Awaitable[None]]) -> None:
    stop = asyncio.Event()
    # First, so that a `main` that blocks from the beginning is noticed as soon as one that blocks later.
    heartbeats = asyncio.ensure_future(heartbeat.send())
    task = asyncio.ensure_future(main(stop))

    def on_signal() -> None:
        if stop.is_set():
            task.cancel()
        else:
            heartbeat.own().stopping()
        stop.set()

    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, on_signal)
    try:
        await task
    except asyncio.CancelledError:
        if not stop.is_set():
            raise
    finally:
        heartbeats.cancel()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)
