"""A simulated robot with a base, the drive program, a driver, and a witness behind the mux."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import psutil
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from bench.video.foreign import end
from common.ros_node import message_class, ros_node
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.drive_peer import Instants
from tests.support.explained import explained_by
from tests.support.ros import SimulatedRobot, simulated_robot
from tests.support.running_drive import worker_of
from tests.support.undisturbed import WORKER_LOST, DisturbedError, no_stall, same_worker
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[2]
BEHIND_THE_MUX: Final = "/mecanum_drive_controller/reference"
_END_S: Final = 10.0
_ATTEMPTS: Final = 5
_ENDED: Final = frozenset({pb.PHASE_INHIBITED, pb.PHASE_STOPPED})
"""Phases in which an attempt to drive has ended."""


@dataclass
class Witness:
    """What reaches the base: (instant in ns of CLOCK_MONOTONIC, speed), in order."""

    seen: list[tuple[int, float]] = field(default_factory=list)

    def take(self, message: Any) -> None:
        """Records a message, when it arrives."""
        twist = message.twist
        speed = abs(twist.linear.x) + abs(twist.linear.y) + abs(twist.angular.z)
        self.seen.append((time.monotonic_ns(), speed))

    def moves(self) -> bool:
        """Whether the newest is motion."""
        return bool(self.seen) and self.seen[-1][1] > 0

    def motion_since(self, since_ns: int) -> list[int]:
        """When motion has arrived since then."""
        return [ns for ns, speed in self.seen if ns >= since_ns and speed > 0]

    def zero_after_ms(self, since_ns: int) -> float:
        """How long after an instant zero has arrived that no motion has followed."""
        last = max(self.motion_since(since_ns), default=since_ns)
        return next((ns - since_ns) / 1e6 for ns, speed in self.seen if ns >= last and not speed)


@contextmanager
def witness() -> Iterator[Witness]:
    """Yields a subscriber behind the mux, on a thread of its own."""
    seen = Witness()
    with ros_node("witness") as node:
        node.create_subscription(
            message_class("geometry_msgs/msg/TwistStamped"), BEHIND_THE_MUX, seen.take, 100
        )
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)

        def spin() -> None:
            with suppress(ExternalShutdownException):
                executor.spin()

        thread = threading.Thread(target=spin)
        thread.start()
        try:
            yield seen
        finally:
            executor.shutdown()
            thread.join(_END_S)


class Observer:
    """Reads the state of the drive program.

    Args:
        path: of its socket.

    Attributes:
        worker: whose states are wanted; None: those of any.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._link: socket.socket | None = None
        self.worker: psutil.Process | None = None

    def close(self) -> None:
        """Disconnects."""
        if self._link:
            self._link.close()
            self._link = None

    def state(self) -> pb.ActualState | None:
        """Returns the newest state; None while the program can't be reached.

        Raises:
            AssertionError: the worker whose states are wanted was lost.
        """
        if self.worker and not self.worker.is_running():
            raise AssertionError(WORKER_LOST)
        try:
            if self._link is None:
                self._link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                self._link.settimeout(3)
                self._link.connect(str(self._path))
                self._link.send(pb.ToDrive(hello=pb.Hello()).SerializeToString())
            newest = self._next()
            while self._pending():
                newest = self._next() or newest
        except OSError:
            self.close()
            return None
        return newest

    def now(self) -> pb.ActualState:
        """Returns the newest state, waiting for the program if need be."""
        return wait_until(self.state, "a state", 30)

    def phase_is(self, *phases: str) -> pb.ActualState:
        """Waits for one of these phases; returns the state."""
        numbers = [pb.Phase.Value(f"PHASE_{phase}") for phase in phases]
        newest = self.now()

        def reached() -> bool:
            nonlocal newest
            newest = self.now()
            return newest.phase in numbers

        try:
            wait_until(reached, f"phase {phases}", 20)
        except AssertionError as error:
            raise AssertionError(f"{error}; it is {newest}") from None
        return newest

    def _next(self) -> pb.ActualState | None:
        assert self._link
        packet = self._link.recv(65536)
        if not packet:
            raise ConnectionResetError
        message = pb.FromDrive.FromString(packet)
        return message.actual if message.HasField("actual") else None

    def _pending(self) -> bool:
        assert self._link
        ready, _, _ = select.select([self._link], [], [], 0)
        return bool(ready)


class Peer:
    """The gateway's end, in a process (tests.support.drive_peer).

    Args:
        path: of the drive program's socket.
        instants: file that it shares.
    """

    def __init__(self, path: Path, instants: Path) -> None:
        self.instants, self.path = Instants(instants), instants
        command = [sys.executable, "-m", "tests.support.drive_peer", str(path), str(instants)]
        self.process = subprocess.Popen(
            command, cwd=_ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout
        assert self.process.stdout.readline() == "ready\n"

    @property
    def gone(self) -> bool:
        """Whether it has ended, as it does when the worker that it is connected with has."""
        return self.process.poll() is not None

    def send(self, **line: Any) -> None:
        """Has it do something."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps(line) + "\n")
        self.process.stdin.flush()

    def close(self) -> None:
        """Ends it, frozen or not."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe
            with suppress(BrokenPipeError):
                pipe.close()
        self.instants.close()


@dataclass
class Driving:
    """Everything that runs.

    Args:
        robot: simulated, with a base.
        directory: for sockets, state and logs.
        settings: of the drive program, beyond those that the tests need.
    """

    robot: SimulatedRobot
    witness: Witness
    directory: Path
    settings: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    guard: "subprocess.Popen[bytes] | None" = None
    peer: Peer | None = None
    peers: int = 0

    def __post_init__(self) -> None:
        self.socket = self.directory / "drive.sock"
        self.log = self.directory / "drive.log"
        self.observer = Observer(self.socket)

    def start(self) -> None:
        """Starts the drive program; it serves when this returns."""
        config = self.directory / "drive.yaml"
        values = {"socket": str(self.socket), "state_dir": str(self.directory / "state")} | self.settings
        config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
        command = [sys.executable, "-m", "drive.cli", "serve", "--config", str(config)]
        with self.log.open("ab") as log:
            # A group of its own, as of a program that a shell starts: in an orphaned one nothing freezes.
            self.guard = subprocess.Popen(
                command, cwd=_ROOT, stderr=log, env=os.environ | self.environment, process_group=0
            )
        wait_until(self.observer.state, "the drive program serves", 30)

    def connect(self) -> Peer:
        """Connects a new gateway's end."""
        if self.peer:
            self.peer.close()
        self.peers += 1
        self.peer = Peer(self.socket, self.directory / f"instants-{self.peers}")
        return self.peer

    def state(self) -> pb.ActualState:
        """Returns the newest state."""
        return self.observer.now()

    def phase_is(self, *phases: str) -> pb.ActualState:
        """Waits for one of these phases; returns the state."""
        return self.observer.phase_is(*phases)

    def inhibited(self) -> pb.ActualState:
        """Waits until a reason ends the motion; returns the state. A lost worker leaves a stop instead."""
        state = self.phase_is("INHIBITED", "STOPPED")
        assert state.phase == pb.PHASE_INHIBITED, f"it is {state}"
        return state

    def ready(self) -> Peer:
        """Connects a new gateway's end and resets what is latched; no one drives when this returns."""
        if self.guard is None or self.guard.poll() is not None:
            self.start()
        wait_until(self.observer.state, "a worker that serves", 30)
        peer = self.connect()
        wait_until(self._available, "no one drives, and no stop is latched", 30)
        return self.peer or peer

    def drive(self, vx: float = 0.1) -> Peer:
        """Drives; the base moves when this returns.

        A machine that is too busy may delay the driver, or the worker, which the guard then replaces. Both
        end the attempt, and the next one begins with a new session.
        """
        for _ in range(_ATTEMPTS):
            peer = self.ready()
            with suppress(BrokenPipeError):
                if self._begins(peer, vx):
                    return peer
        raise AssertionError(f"it does not drive; it is {self.state()}")

    def _begins(self, peer: Peer, vx: float) -> bool:
        """Has it hold; returns whether full speed was reached before the attempt ended.

        Raises:
            BrokenPipeError: the peer has ended.
        """
        peer.send(lease="anna", vx=vx)
        peer.send(held=False)
        wait_until(lambda: peer.gone or self._armed(), "a driver who may begin", 30)
        peer.send(held=True)
        return self._reaches(vx, peer)

    def _reaches(self, vx: float, peer: Peer) -> bool:
        """Waits for full speed; returns whether it was reached before the attempt ended."""
        began_ns = time.monotonic_ns()
        wait_until(lambda: self.state().monotonic_ns > began_ns, "a newer state")
        ended = False

        def decided() -> bool:
            nonlocal ended
            ended = peer.gone or self.state().phase in _ENDED
            return ended or (bool(self.witness.seen) and self.witness.seen[-1][1] > vx - 0.001)

        wait_until(decided, "full speed")
        return not ended

    def _available(self) -> bool:
        state = self.state()
        if self.peer and state.HasField("stop"):
            with suppress(BrokenPipeError):
                peer = self.connect() if self.peer.gone else self.peer
                peer.send(reset=state.stop.stop_id)
        return state.phase == pb.PHASE_AVAILABLE

    def _armed(self) -> bool:
        state = self.state()
        return state.phase == pb.PHASE_ARMED and state.newest_sequence > 0 and not state.inhibits

    @property
    def worker(self) -> psutil.Process:
        """The worker's process."""
        assert self.guard
        return worker_of(self.guard)

    @contextmanager
    def moving(self, *, loses_worker: bool = False) -> Iterator[None]:
        """A part of an attempt that begins in motion, after `drive`; see tests.support.undisturbed.

        Args:
            loses_worker: the block itself ends the worker.

        Raises:
            DisturbedError: the robot is at rest already, the worker was lost without need, or something has
                failed in a stall.
        """
        with no_stall() if loses_worker else self.same_worker():
            if not self.witness.moves():
                raise DisturbedError("the robot was at rest already")
            yield

    @contextmanager
    def same_worker(self) -> Iterator[None]:
        """A part of an attempt, after `ready`; see tests.support.undisturbed.

        Raises:
            DisturbedError: the worker was lost, or something has failed in a stall: a driver who is late then
                has to hold anew.
        """
        try:
            with same_worker(self) as self.observer.worker, no_stall():
                yield
        finally:
            self.observer.worker = None

    def settled(self) -> None:
        """Waits until nothing has reached the base as motion for half a second."""
        wait_until(
            lambda: not self.witness.motion_since(time.monotonic_ns() - 500_000_000), "the robot is at rest"
        )

    def close(self) -> None:
        """Ends everything that was started here."""
        self.observer.close()
        if self.peer:
            self.peer.close()
        if self.guard:
            with suppress(psutil.NoSuchProcess):
                for worker in psutil.Process(self.guard.pid).children():
                    worker.resume()
            self.guard.send_signal(signal.SIGCONT)
            end(self.guard)


@contextmanager
def driving(directory: Path, *behaviour: str, **settings: Any) -> Iterator[Driving]:
    """A robot at rest, in the ROS domain of the environment; the drive program serves."""
    with ExitStack() as stack:
        robot = stack.enter_context(simulated_robot(directory, "--base", "commander=nobody", *behaviour))
        seen = stack.enter_context(witness())
        made = Driving(robot, seen, directory, settings)
        stack.callback(made.close)
        made.start()
        with explained_by(made.log):
            yield made
