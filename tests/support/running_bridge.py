"""The real bridge as a process of its own, beside a hub and a gateway, and what the hub has of it."""

import resource
import subprocess
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import grpc

from bridge.rpc.client import newest_state
from fleet import names
from fleet.connection import FleetAddress, Hub, Start, connect
from hub.jetstream.streams import add_command_consumer, set_up
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.fleet.v1.event_pb2 import DROP_REASON_OUTBOX_LOST, DropReason, EventBatch
from omniseer.gateway.v1 import cloud_pb2
from tests.support.answered import answered
from tests.support.restartable_program import RestartableProgram
from tests.support.waiting import wait_until

_UP_WITHIN_S: Final = 30.0
ROBOT: Final = "lab2"


@dataclass
class Received:
    """What a hub has of a robot's events, and whether it adds up."""

    batches: list[EventBatch] = field(default_factory=list)

    @property
    def events(self) -> list[tuple[str, int]]:
        """Run and sequence of each, in the hub's order."""
        items = (item for batch in self.batches for item in batch.items)
        return [(item.event.run_id, item.event.sequence) for item in items if item.HasField("event")]

    @property
    def missing(self) -> set[tuple[str, int]]:
        """All that the gaps announce."""
        return self._announced(set(DropReason.values()))

    def _announced(self, reasons: Collection[int]) -> set[tuple[str, int]]:
        return {
            (batch.run_id, sequence)
            for batch in self.batches
            for item in batch.items
            if item.HasField("dropped") and item.dropped.reason in reasons
            for sequence in range(item.dropped.first_sequence, item.dropped.last_sequence + 1)
        }

    @property
    def reasons(self) -> set[int]:
        """Of the gaps."""
        items = (item for batch in self.batches for item in batch.items)
        return {item.dropped.reason for item in items if item.HasField("dropped")}

    def add_up_to(self, run_id: str, issued: int) -> bool:
        """Whether all of a run is there or announced; fails where it is there twice or out of order."""
        sequences = [sequence for run, sequence in self.events if run == run_id]
        assert sequences == sorted(set(sequences)), "in order, and each once"
        missing = {sequence for run, sequence in self.missing if run == run_id}
        there = set(sequences) | missing
        assert there <= set(range(1, issued + 1)), "none that was not issued"
        # What the outbox was lost with may have been delivered before: its gap says "not known".
        lost_for_certain = self._announced(set(DropReason.values()) - {DROP_REASON_OUTBOX_LOST})
        assert not lost_for_certain.intersection(self.events), "announced and there"
        return len(there) == issued


async def received(hub: Hub, robot: str = ROBOT) -> Received:
    """Returns all that the hub has now."""
    info = await hub.stream_info(names.EVENTS)
    result = Received()
    if info["state"]["messages"] == 0:
        return result
    last = info["state"]["last_seq"]
    async for delivery in hub.follow(names.EVENTS, f"fleet.{robot}.ev.>", Start.all()):
        batch = EventBatch.FromString(delivery.payload)
        assert delivery.subject == names.event_subject(robot, batch.run_id, batch.first_sequence)
        result.batches.append(batch)
        if delivery.sequence >= last or delivery.pending == 0:
            return result
    return result


async def prepare(servers: tuple[str, ...]) -> None:
    """Makes streams and buckets."""
    async with connect(FleetAddress(servers, name="test")) as hub:
        await hub.connected(10)
        await set_up(hub, len(servers))
        await add_command_consumer(hub, ROBOT)


@dataclass
class BridgeProgram(RestartableProgram):
    """A bridge.

    Attributes:
        settings: keys of its configuration besides those of every test.
    """

    name = "bridge"
    end_within_s = 10

    directory: Path
    gateway_port: int
    servers: tuple[str, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    process: subprocess.Popen[bytes] | None = None

    @property
    def root(self) -> Path:
        return Path(self.settings.get("root", self.directory / "outbox"))

    @property
    def state(self) -> pb.WatchStateResponse:
        return answered(lambda: newest_state(self.socket))

    @property
    def status(self) -> cloud_pb2.CloudStatus:
        return self.state.status

    def start(self, *, wait: bool = True) -> None:
        """Starts it; it serves when this returns, unless not waited for."""
        values = {
            "socket": str(self.socket),
            "root": str(self.root),
            "gateway": {"target": f"127.0.0.1:{self.gateway_port}"},
            "hub": {"servers": list(self.servers), "robot": ROBOT},
            **self.settings,
        }
        self.spawn((sys.executable, "-m", "bridge.cli"), values, self.environment)
        if wait:
            wait_until(self._serves, "the bridge serves", _UP_WITHIN_S)

    @contextmanager
    def full_disk(self) -> Iterator[None]:
        """Its files take nothing more until the block ends: no disk has to be mounted.

        The kernel's error is EFBIG (setrlimit(2)), which the bridge calls an error of the disk; that of a
        full one has another name, and the same consequences.
        """
        before = resource.prlimit(self.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(self.pid, resource.RLIMIT_FSIZE, (0, before[1]))
        try:
            yield
        finally:
            resource.prlimit(self.pid, resource.RLIMIT_FSIZE, before)

    def _serves(self) -> bool:
        self.assert_alive()
        try:
            return bool(self.state.instance_id)
        except grpc.RpcError:
            return False


@contextmanager
def bridge_program(
    directory: Path, gateway_port: int, servers: tuple[str, ...], **settings: Any
) -> Iterator[BridgeProgram]:
    """Not started yet when the block begins, gone when it ends."""
    directory.mkdir(exist_ok=True)
    program = BridgeProgram(directory, gateway_port, servers, settings)
    try:
        yield program
    finally:
        if program.process:
            program.kill()
