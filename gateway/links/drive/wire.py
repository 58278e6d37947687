"""The drive program's socket (omniseer.drive.v1): one packet is one message (SOCK_SEQPACKET of unix(7))."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from google.protobuf.message import DecodeError

from gateway.links.drive.state import DriveCommand, DriveReport, DriveSpec
from gateway.links.reconciler import Desired
from gateway.links.watch import ABSENT, LinkLostError
from gateway.links.wire_values import same_fields
from gateway.status.teleop import (
    FOUND_BY_THE_GATEWAY,
    DriveCounters,
    DriveEpisode,
    DriveInhibit,
    DriveLimits,
    DrivePhase,
    StopLatch,
)
from gateway.status.values import Velocity
from omniseer.drive.v1 import drive_pb2 as pb

_MAX_PACKET_BYTES: Final = 16 * 1024
_WELCOME_WITHIN_S: Final = 1.0

PHASES: Final[Mapping[int, DrivePhase]] = {pb.Phase.Value(f"PHASE_{each.name}"): each for each in DrivePhase}
INHIBITS: Final[Mapping[int, DriveInhibit]] = {
    pb.Inhibit.Value(f"INHIBIT_{each.name}"): each
    for each in DriveInhibit
    if each not in FOUND_BY_THE_GATEWAY
}


@dataclass(frozen=True, slots=True)
class DriveConnector:
    """Connects to the drive program on the Unix socket where it listens, or will.

    Attributes:
        episode_ended: called with the process and each report of a time of motion that has ended, one or more
            times for each: reports are skipped where a newer one has arrived, these are not.
    """

    path: Path
    episode_ended: Callable[[str, DriveEpisode], None]

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["DriveClient"]:
        """Yields a client that the drive program has welcomed.

        Raises:
            LinkLostError: it does not answer.
        """
        try:
            packets = _connected_to(self.path)
        except OSError as error:
            raise LinkLostError(ABSENT, f"{self.path}: {error.strerror or error}") from None
        with packets:
            client = DriveClient(packets, self.episode_ended)
            loop = asyncio.get_running_loop()
            loop.add_reader(packets, client.read)
            try:
                client.send(pb.ToDrive(hello=pb.Hello(gateway=True)))
                await client.welcomed(_WELCOME_WITHIN_S)
                yield client
            finally:
                loop.remove_reader(packets)


def _connected_to(path: Path) -> socket.socket:
    """Returns a connection that does not block.

    Raises:
        OSError: nothing listens there, or this process has no descriptor left.
    """
    packets = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        packets.setblocking(False)
        # A Unix socket connects at once, or not at all.
        packets.connect(str(path))
    except OSError:
        packets.close()
        raise
    return packets


class DriveClient:
    """A ServiceClient of the drive program; `send` is for what can't wait.

    Args:
        packets: connected and not blocking.
        episode_ended: as of the connector.
    """

    def __init__(self, packets: socket.socket, episode_ended: Callable[[str, DriveEpisode], None]) -> None:
        self._packets = packets
        self._episode_ended = episode_ended
        self._welcome: pb.Welcome | None = None
        self._newest: DriveReport | None = None
        self._lost: LinkLostError | None = None
        self._changed = asyncio.Event()

    def send(self, message: pb.ToDrive) -> bool:
        """Sends a message at once, and returns whether it is on its way."""
        try:
            self._packets.send(message.SerializeToString(), socket.MSG_NOSIGNAL | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False  # It does not read: it is frozen, and its own guard sees to that.
        except OSError as error:
            self._lose(LinkLostError(ABSENT, str(error)))
            return False
        return True

    def read(self) -> None:
        """Takes what has arrived; of reports, the newest."""
        try:
            while packet := self._packets.recv(_MAX_PACKET_BYTES):
                self._take(pb.FromDrive.FromString(packet))
            self._lose(LinkLostError("it has closed the connection"))
        except BlockingIOError:
            pass
        except DecodeError:
            self._lose(LinkLostError("it sends what is no message; its version does not match"))
        except LinkLostError as error:
            self._lose(error)
        except OSError as error:
            self._lose(LinkLostError(ABSENT, str(error)))

    async def welcomed(self, within_s: float) -> None:
        """Waits for the drive program's answer to hello.

        Raises:
            LinkLostError: there is none.
        """
        try:
            async with asyncio.timeout(within_s):
                while self._welcome is None and self._lost is None:
                    await self._wait()
        except TimeoutError:
            raise LinkLostError(f"no welcome for {within_s:g} s") from None
        if self._lost:
            raise self._lost

    async def reports(self) -> AsyncIterator[DriveReport]:
        """Yields the newest report whenever there is one that was not yielded yet."""
        last: DriveReport | None = None
        while True:
            if self._newest is not None and self._newest is not last:
                last = self._newest
                yield last
            elif self._lost:
                raise self._lost
            else:
                await self._wait()

    async def apply(self, desired: Desired[DriveSpec]) -> DriveReport:
        """Sends the desired state, and returns the first report that has it applied."""
        state = pb.DesiredState(revision=desired.revision, enabled=desired.spec.enabled)
        self.send(pb.ToDrive(desired=state))
        while self._newest is None or self._newest.applied_revision < desired.revision:
            if self._lost:
                raise self._lost
            await self._wait()
        return self._newest

    async def _wait(self) -> None:
        self._changed.clear()
        await self._changed.wait()

    def _take(self, message: pb.FromDrive) -> None:
        match message.WhichOneof("message"):
            case "welcome":
                self._welcome = message.welcome
            case "actual" if self._welcome:
                self._newest = report = report_from(self._welcome, message.actual)
                if report.episode and report.episode.ended_ns:
                    self._take_ended(report.instance_id, report.episode)
        self._changed.set()

    def _take_ended(self, instance_id: str, episode: DriveEpisode) -> None:
        """Hands a time of motion over, and acknowledges it where the drive program keeps it until then."""
        self._episode_ended(instance_id, episode)
        if episode.recorded is False:
            recorded = pb.Recorded(episode_id=episode.episode_id, started_ns=episode.started_ns)
            self.send(pb.ToDrive(recorded=recorded))

    def _lose(self, error: LinkLostError) -> None:
        if self._lost is None:
            self._lost = error
            asyncio.get_running_loop().remove_reader(self._packets)
        self._changed.set()


def command_message(session_id: str, command: DriveCommand) -> pb.ToDrive:
    """Returns the message of a driver's command."""
    velocity = command.velocity
    return pb.ToDrive(
        command=pb.Command(
            session_id=session_id,
            sequence=command.sequence,
            held=command.held,
            vx_mps=velocity.vx_mps,
            vy_mps=velocity.vy_mps,
            wz_rad_s=velocity.wz_rad_s,
            valid_until_ns=command.valid_until_ns,
            echo_ns=command.echo_ns,
            picture_ns=command.picture_ns,
        )
    )


def report_from(welcome: pb.Welcome, message: pb.ActualState) -> DriveReport:
    """Returns the report in a message.

    Raises:
        LinkLostError: the phase is unknown, because the drive program is of another version.
    """
    phase = PHASES.get(message.phase)
    if phase is None:
        raise LinkLostError(f"it reports the unknown phase {message.phase}; its version does not match")
    return DriveReport(
        instance_id=welcome.instance_id,
        monotonic_ns=message.monotonic_ns,
        applied_revision=message.applied_revision,
        phase=phase,
        # Unknown ones are of a newer drive program: it does not move, as the phase says.
        inhibits=tuple(INHIBITS[each] for each in message.inhibits if each in INHIBITS),
        session_id=message.session_id,
        velocity=same_fields(Velocity, message),
        speed_limit_mps=message.speed_limit_mps,
        turn_limit_rad_s=message.turn_limit_rad_s if message.HasField("turn_limit_rad_s") else None,
        limits=same_fields(DriveLimits, welcome.limits),
        stop=same_fields(StopLatch, message.stop) if message.HasField("stop") else None,
        counters=same_fields(DriveCounters, message.counters),
        episode=same_fields(DriveEpisode, message.episode) if message.HasField("episode") else None,
        problems=tuple(message.problems),
        reset_obstacle=message.reset_obstacle,
        enabled=message.enabled if message.HasField("enabled") else None,
        base_timeout_ms=welcome.base_timeout_ms if welcome.HasField("base_timeout_ms") else None,
    )
