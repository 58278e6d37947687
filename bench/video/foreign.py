"""Starts and ends programs; those that are not the project's own get an environment without its libraries."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

_END_WITHIN_S: Final = 10


def environment() -> dict[str, str]:
    """Returns this process's environment without the libraries of the ROS wheels."""
    return {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}


def spawn(
    *command: str, own: bool = False, more: Mapping[str, str] | None = None
) -> "subprocess.Popen[bytes]":
    """Starts a program; its output goes to this process's standard error.

    Args:
        command: program and arguments.
        own: whether it is one of the project's and keeps the whole environment.
        more: additional environment variables.
    """
    variables = (dict(os.environ) if own else environment()) | dict(more or {})
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sys.stderr, env=variables)


def end(process: "subprocess.Popen[Any]") -> None:
    """Terminates a program, and kills it where that takes too long."""
    process.terminate()
    try:
        process.wait(_END_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def running(*command: str, own: bool = False) -> Iterator["subprocess.Popen[bytes]"]:
    """Runs a program until the block ends; arguments as those of `spawn`."""
    process = spawn(*command, own=own)
    try:
        yield process
    finally:
        end(process)
