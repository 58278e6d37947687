"""Signals that end a command, in whatever it is interrupted."""

import os
import signal
import subprocess
import sys
from textwrap import dedent

ROUNDS = 100
PROGRAM = dedent(
    f"""
    import signal
    import time

    from console.cli.stopping import until_stopped

    # The second signal of a round may come after its end.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for _ in range({ROUNDS}):
        with until_stopped(lambda: None) as stopped:
            print("ready", flush=True)
            while not any(stopped.event.wait(0.0) for _ in range(100)):
                # A signal that the kernel has given to another thread, the one that ends the round before, is
                # handled once the main thread takes the GIL again (bpo-40010). Without this it never would.
                time.sleep(0)
    """
)


def test_two_signals_in_the_midst_of_a_look_at_the_event_end_the_command() -> None:
    command = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            for _ in range(ROUNDS):
                assert process.stdout.readline() == "ready\n"
                os.kill(process.pid, signal.SIGTERM)
                os.kill(process.pid, signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()
