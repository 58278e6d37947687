"""Signals that end a command, in whatever it is interrupted."""

import os
import signal
import subprocess
import sys
from textwrap import dedent

PROGRAM = dedent(
    """
    from console.cli.stopping import until_stopped

    with until_stopped(lambda: None) as stopped:
        print("ready", flush=True)
        while not stopped.event.wait(0.0):
            pass
    """
)


def ended() -> int:
    """Returns the exit code of a program that looks at the event all the time, and is asked to end."""
    command = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        process.stdout.readline()
        os.kill(process.pid, signal.SIGTERM)
        os.kill(process.pid, signal.SIGINT)
        try:
            return process.wait(20)
        finally:
            process.kill()


def test_two_signals_in_the_midst_of_a_look_at_the_event_end_the_program() -> None:
    assert [ended() for _ in range(20)] == [0] * 20
