"""The guard of a pulse, in the doctor's process: a pulse that is silent is killed, and zeros go out."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from drive.config import DriveSettings
from drive.doctor.facts import PulseFacts
from drive.doctor.pulse import BEAT, PULSE_MPS
from drive.motion.values import ZERO
from drive.processes.guard import HEARTBEATS
from drive.ros.base import VelocityPublisher

_START_S: Final = 20.0
"""From the start of the process to its first heartbeat; imports and the discovery of ROS take seconds."""
_SILENT_S: Final = 0.25
"""Twelve steps of the pulse, which has no real-time priority; at its speed that is a centimetre."""
_END_S: Final = 5.0
"""For a pulse that has reported, and has said zero before that, to leave the graph."""
_MAX_BYTES: Final = 4096


class _LostError(Exception):
    """The pulse does not go on; its text says what it did."""


def guarded_pulse(node: Any, settings: DriveSettings, config_file: Path | None) -> PulseFacts:
    """Moves the robot from a process of its own; returns what that has shown.

    It ends with zeros, whatever happens to either process. If both are frozen or killed at once, only the
    base's own timeout stops the robot.

    Args:
        node: of rclpy; for the zeros.
        settings: of the drive program.
        config_file: that they come from.
    """
    velocities = VelocityPublisher(node, settings.outputs)
    command = [sys.executable, "-m", "drive.cli", "pulse"]
    if config_file:
        command += ["--config", str(config_file)]
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        with theirs:
            # A group of its own: Ctrl-Z freezes the doctor alone. Without common.child.end_with_parent: when
            # the doctor is killed, the pulse has to say zero, and ends as its heartbeats reach nothing.
            process = subprocess.Popen(  # noqa: S603  # this program itself
                command,
                env=os.environ | {HEARTBEATS: str(theirs.fileno())},
                pass_fds=[theirs.fileno()],
                process_group=0,
            )
        try:
            facts = _followed(ours)
            with suppress(subprocess.TimeoutExpired):
                process.wait(_END_S)
        except _LostError as lost:
            return PulseFacts(PULSE_MPS, None, None, f"was ended early: {lost}")
        else:
            return facts
        finally:
            with _undisturbed():
                # First the kill, then the zeros: a process that thaws must not have the last word.
                process.kill()
                process.wait()
                velocities.publish(ZERO)
                velocities.wait_until_acknowledged()


def _followed(pulse: socket.socket) -> PulseFacts:
    """Reads heartbeats until the result comes.

    Raises:
        _LostError: the pulse has to be killed.
    """
    patience_s = _START_S
    while True:
        ready, _, _ = select.select([pulse], [], [], patience_s)
        if not ready:
            raise _LostError(f"its process was silent for {patience_s * 1000:.0f} ms")
        packet = pulse.recv(_MAX_BYTES)
        if not packet:
            raise _LostError("its process has ended")
        if packet != BEAT:
            return PulseFacts(**json.loads(packet))
        patience_s = _SILENT_S


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Ignores the signals that end a program while the block lasts."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    handlers = [signal.signal(number, signal.SIG_IGN) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)
