"""Assembles the guard and the worker, each of them a process."""

import logging
import signal
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Final

from common.garbage import freeze_objects
from common.ros_node import OwnNode, ros_node
from common.ros_transport import use_udp
from drive.config import DriveSettings
from drive.endpoint.endpoint import Endpoint
from drive.endpoint.wire import welcome
from drive.motion.machine import OnLoss, State
from drive.motion.values import Latch
from drive.processes.guard import Guard, worker_heartbeats, worker_kills, worker_stops
from drive.processes.real_time import lock_memory, raise_priority
from drive.processes.stop_file import StopFile, Stops, read_stops
from drive.processes.worker import Worker, new_instance_id
from drive.ros.base import VelocityPublisher, base

_log = logging.getLogger(__name__)

_WORKER_PRIORITY: Final = 10
_GUARD_PRIORITY: Final = 11
"""Above the worker's, which it has to end."""
_ENDING: Final = (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT, signal.SIGHUP)
"""What ends the guard, and so the worker: a service manager, Ctrl-C, Ctrl-\\, a terminal that is closed."""
_FREEZING: Final = (signal.SIGTSTP, signal.SIGTTOU)
"""From a terminal, to both processes at once: Ctrl-Z, and what is written by a program in the background."""


def serve(settings: DriveSettings, config_file: Path | None) -> int:
    """Runs the guard until a signal ends it; returns the exit code.

    Raises:
        UserError: ROS 2 or the state directory can't be used.
    """
    command = [sys.executable, "-m", "drive.cli", "worker"]
    if config_file:
        command += ["--config", str(config_file)]
    path = settings.stop_path
    stop_file = StopFile(path)
    use_udp(settings.state_dir)
    with ros_node(OwnNode.DRIVE_GUARD) as node:
        velocities = VelocityPublisher(node, settings.outputs)
        guard = Guard(command, velocities, settings.on_loss, stop_file, read_stops(path))
        _take_signals(guard)
        raise_priority(_GUARD_PRIORITY)
        lock_memory()
        freeze_objects()
        code = guard.run()
    stop_file.close()
    return code


def _take_signals(guard: Guard) -> None:
    """Has signals end the guard in order. Nothing a terminal sends ends or freezes both processes at once."""
    for number in _ENDING:
        # nohup has one of them ignored, and a script that starts the program in the background two.
        if number is signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: guard.stop())
    for number in _FREEZING:
        signal.signal(number, signal.SIG_IGN)  # In the worker as well, which inherits that.


def work(settings: DriveSettings) -> None:
    """Runs the worker, which the guard has started, until SIGTERM.

    Raises:
        UserError: ROS 2 or the socket can't be used.
    """
    rules = settings.rules
    stops = worker_stops()
    # Whether driving is enabled is the gateway's to say; until it does, there is no driver.
    state = State.at_start(time.monotonic_ns(), enabled=False, latch=stops.latch, last_stop_id=stops.last_id)
    with (
        worker_heartbeats() as heartbeats,
        base(settings, lock_left=stops.lock_left) as robot_base,
        Endpoint(settings.socket, welcome(new_instance_id(), rules, settings.base_timeout_ms)) as endpoint,
    ):
        worker = Worker(
            robot_base,
            endpoint,
            heartbeats,
            rules,
            state,
            episode=stops.episode,
            worker_kills=worker_kills(),
        )

        def stop(_number: int, _frame: FrameType | None) -> None:
            worker.stopping = True

        # A terminal sends the others to the worker, too; the guard decides.
        for number in _ENDING:
            signal.signal(number, stop if number is signal.SIGTERM else signal.SIG_IGN)
        raise_priority(_WORKER_PRIORITY)
        lock_memory()
        _log.info("listening on %s", settings.socket)
        worker.run()
    if worker.orphaned:
        _keep_loss(settings, worker)


def _keep_loss(settings: DriveSettings, worker: Worker) -> None:
    """Leaves a stop for the next start, where a driver lost the robot by the end of the guard.

    Otherwise the guard keeps stops, the motion that is to be recorded, and a lock that is left; it has gone.
    """
    state = worker.state
    latch = state.latch
    if latch is None and state.held_last and settings.on_loss is OnLoss.HOLD:
        reason = "the guard of robot-drive was lost while a driver had the robot"
        latch = Latch(state.last_stop_id + 1, "robot-drive", reason)
    if latch or worker.unrecorded or worker.lock_left:
        stop_file = StopFile(settings.stop_path)
        last_id = latch.stop_id if latch else state.last_stop_id
        stop_file.keep(Stops(last_id, latch, worker.unrecorded, worker.lock_left))
        stop_file.close()
