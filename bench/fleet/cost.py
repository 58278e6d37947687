"""What a fleet costs a server of the hub: CPU time, memory and disk, with 10, 100 and 1000 robots.

Each robot has a connection of its own, with TLS and its own credentials, as a bridge has. Two loads:

- as robots send: a state a second, and an event a minute each. This is what docs/fleet.md has by size;
- 1000 states a second whatever the number of robots: what one costs is compared, and a server that wakes up
  for a few messages a second needs more CPU time for each of them, however few robots there are.
"""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from bench.fleet_sizes import EVENT_BYTES, EVENT_EVERY_S, SIZES
from bench.processes import cpu_seconds, resident_mib
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from fleet import names
from fleet.connection import FleetAddress, Hub, connect
from tests.support.secure_hub import SecureHub, secure_hub

FEWEST, FEW, MANY = SIZES
WINDOW_S: Final = 5.0
BAR: Final = 1.5
_STATE: Final = b"x" * 400
_STATES_S: Final = 1000.0
"""Of all robots together, under the second load."""
_AT_ONCE: Final = 20
"""Robots that connect at the same time: more would not be through with TLS within its time-out."""
_MOST_OFF: Final = 0.15
"""Part of the intended states that may be missing, or too many, in a window."""
_EVENTS: Final = 5
"""Of each robot, to see what they take on the disk."""
_ANSWER_S: Final = 10.0


@dataclass(frozen=True)
class Cost:
    """Of a fleet of one size.

    Attributes:
        cpu_percent: of a core, with a state a second and an event a minute from each robot.
        mib: resident memory of the server meanwhile.
        state_us: CPU time for each of 1000 states a second.
        event_bytes: on the disk for each event.
    """

    cpu_percent: float
    mib: float
    state_us: float
    event_bytes: float


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    costs: dict[int, list[Cost]] = {robots: [] for robots in SIZES}
    for number in range(FEWEST_ROUNDS):
        for robots in SIZES:
            costs[robots].append(one_round(workdir / f"{robots}-{number}", robots))
            log(f"fleet: {robots} robots: {costs[robots][-1]}")
    return [row for row in (*_promised(costs), *_by_size(costs)) if row.name in wanted]


def one_round(directory: Path, robots: int) -> Cost:
    with secure_hub(directory) as hub:
        return asyncio.run(_cost(hub, robots))


def added_kib(more: list[Cost], less: list[Cost], robots: int) -> list[float]:
    """Returns what each robot has added to the memory of the server, round by round.

    Args:
        more: with `robots` more than `less`; what the server takes for its work itself is in both.
        less: the smaller fleet.
        robots: by which the fleets differ.
    """
    return [(many.mib - few.mib) * 1024 / robots for many, few in zip(more, less, strict=True)]


def _promised(costs: dict[int, list[Cost]]) -> list[Row]:
    own = "each robot over TLS with a connection and credentials of its own"
    states = [
        Row(
            name=name,
            what=f"CPU time of the server for each of {_STATES_S:.0f} states a second, from {robots} robots,"
            f" against {FEWEST} that send as many, {own}",
            unit="us",
            values=[each.state_us for each in costs[robots]],
            references=[each.state_us for each in costs[FEWEST]],
            bar=BAR,
        )
        for name, robots in (("fleet.state_cpu_us", MANY), (f"fleet.state_cpu_{FEW}_us", FEW))
    ]
    memory = Row(
        name="fleet.robot_kib",
        what=f"memory of the server for each robot from {FEW} to {MANY}, against each from {FEWEST} to {FEW},"
        f" {own}",
        unit="KiB",
        values=added_kib(costs[MANY], costs[FEW], MANY - FEW),
        references=added_kib(costs[FEW], costs[FEWEST], FEW - FEWEST),
        bar=BAR,
    )
    return [memory, *states]


def _by_size(costs: dict[int, list[Cost]]) -> list[Row]:
    load = "robots over TLS, with a state a second and an event a minute each, one node"
    found = [
        Row(
            name="fleet.event_disk_bytes",
            what=f"what the server's disk needs for an event of {EVENT_BYTES} bytes, one in a message",
            unit="bytes",
            values=[each.event_bytes for each in costs[MANY]],
            bar=None,
        )
    ]
    for robots in SIZES:
        found += [
            Row(
                name=f"fleet.hub_{robots}_cpu",
                what=f"CPU of the server: {robots} {load}",
                unit="% of a core",
                values=[each.cpu_percent for each in costs[robots]],
                bar=None,
            ),
            Row(
                name=f"fleet.hub_{robots}_mib",
                what=f"resident memory of the server: {robots} {load}",
                unit="MiB",
                values=[each.mib for each in costs[robots]],
                bar=None,
            ),
        ]
    return found


@dataclass
class _Load:
    """Robots that send. Attributes: `states`, those that the hub has taken."""

    hubs: list[Hub]
    states: int = 0
    _events: dict[int, int] = field(default_factory=dict)

    async def state(self, robot: int) -> None:
        """Sends a robot's state."""
        await self.hubs[robot].put(names.STATES, _name(robot), _STATE, _ANSWER_S)
        self.states += 1

    async def event(self, robot: int) -> None:
        """Sends a robot's next event."""
        number = self._events[robot] = self._events.get(robot, 0) + 1
        subject = names.event_subject(_name(robot), "run", number)
        await self.hubs[robot].publish_once(subject, b"x" * EVENT_BYTES, _ANSWER_S)

    @asynccontextmanager
    async def each(self, period_s: float, send: Callable[[int], Awaitable[None]]) -> AsyncGenerator[None]:
        """Has each robot send once in a period, for a block; the robots are spread evenly over it."""
        async with asyncio.TaskGroup() as tasks:
            count = len(self.hubs)
            senders = [
                tasks.create_task(_at_each(period_s, period_s * robot / count, send, robot))
                for robot in range(count)
            ]
            yield
            for sender in senders:
                sender.cancel()


async def _at_each(
    period_s: float, first_s: float, send: Callable[[int], Awaitable[None]], robot: int
) -> None:
    clock = asyncio.get_running_loop().time
    due_s = clock() + first_s
    while True:
        await asyncio.sleep(due_s - clock())
        await send(robot)
        due_s = max(due_s + period_s, clock())


async def _cost(hub: SecureHub, robots: int) -> Cost:
    process = hub.servers.processes[0]
    if process is None:
        raise RuntimeError("the server does not run")
    pid = process.pid
    async with AsyncExitStack() as stack:
        load = _Load(await _connected(stack, [hub.unlisted_robot(_name(each)) for each in range(robots)]))
        async with load.each(1.0, load.state), load.each(EVENT_EVERY_S, load.event):
            cpu_s, _ = await _window(pid, load, robots)
            mib = resident_mib(pid)
        async with load.each(robots / _STATES_S, load.state):
            states_s, states = await _window(pid, load, _STATES_S)
        before = _disk_bytes(hub)
        async with asyncio.TaskGroup() as tasks:
            for robot in range(robots):
                tasks.create_task(_events(load, robot))
        event_bytes = (_disk_bytes(hub) - before) / (robots * _EVENTS)
    return Cost(100 * cpu_s / WINDOW_S, mib, 1e6 * states_s / states, event_bytes)


async def _connected(stack: AsyncExitStack, addresses: list[FleetAddress]) -> list[Hub]:
    hubs: list[Hub] = []
    for first in range(0, len(addresses), _AT_ONCE):
        some = [
            await stack.enter_async_context(connect(each)) for each in addresses[first : first + _AT_ONCE]
        ]
        for hub in some:
            await hub.connected(60)
        hubs += some
    return hubs


async def _window(pid: int, load: _Load, rate: float) -> tuple[float, int]:
    """Returns the CPU time of the server in a window, in s, and the states that it has taken meanwhile.

    Args:
        pid: of the server.
        load: which sends.
        rate: states a second that are to be sent.

    Raises:
        RuntimeError: the load was another one.
    """
    await asyncio.sleep(1.0)  # every robot has sent once
    before_s, first = cpu_seconds(pid), load.states
    await asyncio.sleep(WINDOW_S)
    spent_s, states = cpu_seconds(pid) - before_s, load.states - first
    check_load(states, rate)
    return spent_s, states


def check_load(states: int, rate: float) -> None:
    """Checks that the states of a window were sent at a rate.

    Raises:
        RuntimeError: they are more than 15 % off: the machine was too busy to send them.
    """
    meant = rate * WINDOW_S
    if abs(states - meant) > _MOST_OFF * meant:
        raise RuntimeError(
            f"the server has taken {states} states in {WINDOW_S:g} s instead of {meant:g}:"
            " the figures would mean nothing"
        )


async def _events(load: _Load, robot: int) -> None:
    for _ in range(_EVENTS):
        await load.event(robot)


def _disk_bytes(hub: SecureHub) -> int:
    """Returns the size of the events' blocks, which is what grows with their number."""
    blocks = hub.servers.directory.rglob(f"streams/{names.EVENTS}/msgs/*.blk")
    return sum(each.stat().st_size for each in blocks)


def _name(robot: int) -> str:
    return f"r{robot}"
