"""What the bridge takes of the robot's computer, at a state and an event a second, as docs/fleet.md promises.

The real program, over TLS, beside a gateway that lists recordings and reads the bridge's reports as the real
one does. In turns: with `hub.receipts`, so that it looks at the recordings, none of which is to be copied;
without; and a publisher of the same messages with the NATS library alone, which is what any program takes
that sends them.
"""

import asyncio
import itertools
from collections.abc import AsyncGenerator
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.processes import cpu_seconds, program, resident_mib
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from common.tasks import cancel
from fleet import names
from fleet.connection import Hub, connect
from gateway.links.bridge.wire import BridgeConnector
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1.system_status_pb2 import RobotHealth, SystemStatus
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.running_bridge import ROBOT, BridgeProgram, bridge_program
from tests.support.secure_hub import SecureHub, secure_hub

BAR_CPU_PERCENT: Final = 1.0
BAR_MIB: Final = 80.0
"""Both: docs/fleet.md."""
_RECORDINGS: Final = 100
_SETTLE_S: Final = 5
_WINDOW_S: Final = 30
"""In which it looks at the robot's recordings once."""
_MOST_OFF: Final = 3
"""Messages that may be missing, or too many, in a window."""


@dataclass(frozen=True)
class Taken:
    """By a program in a window."""

    cpu_percent: float
    mib: float


@dataclass
class _Kind:
    """One of the programs that are compared."""

    cpu_percent: list[float]
    mib: list[float]

    def add(self, taken: Taken) -> None:
        self.cpu_percent.append(taken.cpu_percent)
        self.mib.append(taken.mib)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    full, plain, bare = (_Kind([], []) for _ in range(3))
    with secure_hub(workdir / "hub") as hub:
        hub.enroll(ROBOT)
        for number in range(FEWEST_ROUNDS):
            for name, kind in (("full", full), ("plain", plain)):
                kind.add(asyncio.run(of_bridge(hub, workdir / f"{name}{number}", uploads=kind is full)))
            bare.add(asyncio.run(of_bare_publisher(hub)))
            log(f"fleet: bridge {full}, without uploads {plain}, bare publisher {bare}")
    return [row for row in _rows(full, plain, bare) if row.name in wanted]


def _rows(full: _Kind, plain: _Kind, bare: _Kind) -> list[Row]:
    load = "a state and an event a second over TLS"
    variants = (
        ("", f"robot-bridge with hub.receipts and {_RECORDINGS} recordings, none to be copied, {load}", full),
        ("_without_uploads", f"robot-bridge without hub.receipts, {load}", plain),
    )
    found = []
    for name, what, kind in variants:
        measures = (
            ("cpu", "CPU", "% of a core", kind.cpu_percent, bare.cpu_percent, BAR_CPU_PERCENT),
            ("mib", "resident memory", "MiB", kind.mib, bare.mib, BAR_MIB),
        )
        for suffix, measure, unit, values, references, bar in measures:
            row = f"fleet.bridge{name}_{suffix}"
            of = f"{measure} of {what}"
            found += [
                Row(name=row, what=of, unit=unit, values=values, bar=bar),
                Row(
                    name=f"{row}_against_bare",
                    what=f"{of}, against a bare publisher of the same messages with the NATS library alone",
                    unit=unit,
                    values=values,
                    references=references,
                    bar=None,
                ),
            ]
    return found


async def of_bridge(hub: SecureHub, directory: Path, *, uploads: bool) -> Taken:
    """Measures a bridge of its own; an outbox that is made anew, beside a new run of the gateway."""
    files = hub.path / ROBOT
    settings = {
        "hub": {
            "servers": list(hub.servers.urls),
            "credentials": str(files / "bridge.creds"),
            "ca": str(files / "ca.pem"),
            "robot": ROBOT,
            "fleet": "lab",
            **({"receipts": str(files / "receipts.pub")} if uploads else {}),
        },
        "commands": {"allowed": ["upload", "snapshot"]},
    }
    # A run of its own: the hub would refuse events of one that it has.
    async with (
        EventServer(kept=1024, recordings=_RECORDINGS, name=directory.name) as gateway,
        connect(hub.administrator()) as connection,
    ):
        await connection.connected(10)
        with bridge_program(directory, gateway.port, hub.servers.urls, **settings) as bridge:
            await asyncio.to_thread(bridge.start)
            async with _beside(bridge, gateway):
                await eventually(
                    lambda: _sent(bridge, connection), lambda sent: min(sent) > 0, "it sends", 40.0
                )
                await asyncio.sleep(_SETTLE_S)
                before = await _sent(bridge, connection)
                taken = await _taken(bridge.pid)
                after = await _sent(bridge, connection)
    check_arrived(before, after)
    return taken


def check_arrived(before: tuple[int, int], after: tuple[int, int]) -> None:
    """Checks that an event and a state a second came to the hub in a window.

    Args:
        before: events and states that it had at the beginning.
        after: those at the end.

    Raises:
        RuntimeError: other numbers came; some are under way at the window's ends.
    """
    arrived = [end - begin for begin, end in zip(before, after, strict=True)]
    if any(abs(each - _WINDOW_S) > _MOST_OFF for each in arrived):
        raise RuntimeError(
            f"{arrived} events and states arrived in {_WINDOW_S} s: the figures would mean nothing"
        )


async def _sent(bridge: BridgeProgram, connection: Hub) -> tuple[int, int]:
    """Returns how many events and states the hub has taken from this run of the bridge."""
    report = await asyncio.to_thread(lambda: bridge.state)
    entry = (await connection.entries(names.STATES)).get(ROBOT)
    state = RobotState.FromString(entry.value) if entry else RobotState()
    return report.status.events_sent, state.sequence if state.bridge_run_id == report.instance_id else 0


@asynccontextmanager
async def _beside(bridge: BridgeProgram, gateway: EventServer) -> AsyncGenerator[None]:
    """Has the gateway read the bridge's reports, and show an event and a status each second, for a block."""
    tasks = [asyncio.create_task(_reports(bridge)), asyncio.create_task(_happening(gateway))]
    try:
        yield
    finally:
        await cancel(tasks)


async def _reports(bridge: BridgeProgram) -> None:
    async with BridgeConnector(bridge.socket).connect() as client:
        async for _ in client.reports():
            pass


async def _happening(gateway: EventServer) -> None:
    clock = asyncio.get_running_loop().time
    begun_s = clock()
    for second in itertools.count(1):
        gateway.happen(1)
        gateway.show(SystemStatus(health=RobotHealth(summary=f"second {second}")))
        await asyncio.sleep(begun_s + second - clock())


async def of_bare_publisher(hub: SecureHub) -> Taken:
    """Measures a program that sends the newest messages of a bridge again and again."""
    async with connect(hub.administrator()) as connection:
        await connection.connected(10)
        state = (await connection.entries(names.STATES))[ROBOT].value
        event = await connection.last(names.EVENTS, names.event_subjects(ROBOT))
        if event is None:
            raise RuntimeError("no bridge has sent an event before")
        payloads = {hub.path / "state": state, hub.path / "event": event.payload}
        for file, payload in payloads.items():
            file.write_bytes(payload)
        arguments = (hub.servers.urls[0], str(hub.path / ROBOT), ROBOT, *map(str, payloads))
        with ExitStack() as stack:
            process = await asyncio.to_thread(
                stack.enter_context, program("bench.fleet.bare_publisher", *arguments)
            )
            await asyncio.sleep(_SETTLE_S)
            before = await _held(connection)
            taken = await _taken(process.pid)
            after = await _held(connection)
    check_arrived(before, after)
    return taken


async def _held(connection: Hub) -> tuple[int, int]:
    """Returns how many events and states the hub has taken from all robots."""
    events = await connection.stream_info(names.EVENTS)
    states = await connection.stream_info(f"KV_{names.STATES}")
    return events["state"]["last_seq"], states["state"]["last_seq"]


async def _taken(pid: int) -> Taken:
    before_s = cpu_seconds(pid)
    await asyncio.sleep(_WINDOW_S)
    return Taken(100 * (cpu_seconds(pid) - before_s) / _WINDOW_S, resident_mib(pid))
