"""Programs that are not ours: gst-launch-1.0, ffmpeg."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def environment() -> dict[str, str]:
    """Ours, without the libraries of the ROS wheels, which don't concern them."""
    return {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}


@contextmanager
def running(*command: str, own: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """A program until the block ends; what it prints goes to our standard error.

    Args:
        command: program and arguments.
        own: whether it is one of ours and keeps our environment.
    """
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=sys.stderr, env=None if own else environment()
    ) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
