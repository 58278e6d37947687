"""One siege: the operator alone, then besieged, in turns."""

import asyncio
import json
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass, field, replace

from bench.progress import log
from bench.siege.crowd import Counts
from bench.siege.gauge import Peaks, gauging
from bench.siege.ground import Ground
from bench.siege.operator import Operator, Record
from bench.siege.size import Plan, Size
from console.client import AsyncGatewayClient, NotAllowed
from console.robots.login import parse_login
from gateway.access.role import Role

_RECOVERY_S = 3.0
"""After the attackers have left, until the operator counts as alone: their connections are closed by then."""
_TAKEN_OVER_WITHIN_S = 10.0
_TAKEN_OVER_POLL_S = 0.1
_END_WITHIN_S = 20.0
_OPERATOR = "siege-operator"


@dataclass
class Outcome:
    """What a siege came to.

    Attributes:
        alone: the operator, undisturbed, per turn.
        beside: the same while two programs without connections take the attackers' core, per turn.
        besieged: the same under attack.
        between: the same while attackers get ready, and while the gateway recovers from them.
        attacks: what the attackers achieved, per process and turn.
        revocation_s: from a revocation on the disk to the end of the last stream of the revoked, per turn.
        peaks: of the gateway's program.
        closed: connections that the gateway's guard has closed; None where that is not known.
        unbesieged_mib: resident memory, peak before the first attack: the operator works, streams are open.
    """

    peaks: Peaks
    alone: list[Record] = field(default_factory=list)
    beside: list[Record] = field(default_factory=list)
    besieged: list[Record] = field(default_factory=list)
    between: list[Record] = field(default_factory=list)
    attacks: list[Counts] = field(default_factory=list)
    revocation_s: list[float] = field(default_factory=list)
    closed: float | None = None
    unbesieged_mib: float = 0.0


async def besiege(ground: Ground, size: Size) -> Outcome:
    """Measures; the ground's gateway has to run.

    Raises:
        RuntimeError: a process of the attack has failed: nothing was measured.
    """
    login = parse_login(await _added(ground, _OPERATOR, Role.OPERATOR))
    operator = Operator(ground.target, login.credentials)
    assert login.credentials.token
    # One of a credential that does not exist, and one of the operator's with another secret.
    wrong = ("rgt-000000000000." + "A" * 43, login.credentials.token[:-8] + "A" * 8)
    floods = Plan(flooders=size.flooders, tokens=wrong)
    async with gauging(ground.pid) as peaks, operator.working():
        outcome = Outcome(peaks)
        before = await asyncio.to_thread(ground.closed_connections)
        for turn in range(size.turns):
            outcome.alone.append(operator.begin_record())
            await asyncio.sleep(size.alone_s)
            outcome.beside.append(await _beside(ground, operator, size.alone_s))
            name = f"siege-revoked-{turn}"
            outcome.between.append(operator.begin_record())
            async with (
                _streams(ground, name, size.streams) as streams,
                _attack(ground, replace(size.holders, turn=turn)) as holders,
                _attack(ground, replace(floods, turn=turn)) as flooders,
            ):
                outcome.besieged.append(operator.begin_record())
                outcome.unbesieged_mib = outcome.unbesieged_mib or peaks.resident_mib
                for each in (holders, flooders):
                    each.begin()
                await asyncio.sleep(size.besieged_s / 2)
                await asyncio.to_thread(ground.keeper.revoke, name)
                revoked_s = time.monotonic()
                await asyncio.sleep(size.besieged_s / 2)
                outcome.between.append(operator.begin_record())
                outcome.attacks += [await holders.end(), await flooders.end()]
                outcome.revocation_s.append(max(0.0, await _last_end_s(streams) - revoked_s))
            await asyncio.sleep(_RECOVERY_S)
            log(f"siege: turn {turn + 1} of {size.turns}")
        after = await asyncio.to_thread(ground.closed_connections)
        outcome.closed = None if after is None or before is None else after - before
    await asyncio.to_thread(ground.keeper.revoke, _OPERATOR)
    return outcome


async def _beside(ground: Ground, operator: Operator, duration_s: float) -> Record:
    """What the operator notices of the attackers' CPU alone, on this machine; not of their connections."""
    async with _attack(ground, Plan(burns=True)) as one, _attack(ground, Plan(burns=True)) as other:
        for each in (one, other):
            each.begin()
        record = operator.begin_record()
        await asyncio.sleep(duration_s)
        operator.begin_record()
        await one.end()
        await other.end()
    return record


async def _added(ground: Ground, name: str, role: Role) -> str:
    """Returns a new login that the gateway has taken over."""
    login = await asyncio.to_thread(ground.keeper.add, name, role)
    credentials = parse_login(login).credentials
    async with (
        asyncio.timeout(_TAKEN_OVER_WITHIN_S),
        AsyncGatewayClient(ground.target, credentials=credentials) as client,
    ):
        while True:
            try:
                await client.status()
            except NotAllowed:
                await asyncio.sleep(_TAKEN_OVER_POLL_S)
            else:
                return login


@asynccontextmanager
async def _streams(ground: Ground, name: str, count: int) -> AsyncIterator[asyncio.subprocess.Process]:
    """Streams of a new credential; each has had a status when the block begins."""
    login = await _added(ground, name, Role.VIEWER)
    async with _process("bench.siege.streams", ground.target, str(count)) as process:
        assert process.stdin
        process.stdin.write(login.encode())
        process.stdin.close()
        await _ready(process)
        yield process


async def _last_end_s(streams: asyncio.subprocess.Process) -> float:
    async with asyncio.timeout(_END_WITHIN_S):
        return float(await _output(streams))


class _Attack:
    """Attackers that are ready."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdin
        self._process, self._commands = process, process.stdin

    def begin(self) -> None:
        self._commands.write(b"\n")

    async def end(self) -> Counts:
        """Returns what they achieved."""
        self._commands.close()
        async with asyncio.timeout(_END_WITHIN_S):
            return Counts(**json.loads(await _output(self._process)))


@asynccontextmanager
async def _attack(ground: Ground, plan: Plan) -> AsyncIterator[_Attack]:
    words = ("bench.siege.attack", ground.host, str(ground.port), json.dumps(asdict(plan)))
    async with _process(*words) as process:
        await _ready(process)
        yield _Attack(process)


@asynccontextmanager
async def _process(*words: str) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", *words), stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def _ready(process: asyncio.subprocess.Process) -> None:
    if (await _line(process)).strip() != "ready":
        raise RuntimeError("a process of the siege did not start")


async def _output(process: asyncio.subprocess.Process) -> str:
    """Returns the line that a process ends with."""
    line = await _line(process)
    if await process.wait():
        raise RuntimeError("a process of the siege failed")
    return line


async def _line(process: asyncio.subprocess.Process) -> str:
    assert process.stdout
    return (await process.stdout.readline()).decode()
