"""How long the base moves after a fault: behind the multiplexer, until a zero that no motion follows.

Each round has a gateway and a driver of its own.
"""

import asyncio
import os
import signal
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal

from bench.drive.ground import Driver, Ground, driver, link, link_to
from bench.processes import program
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.bad_links import Relay
from tests.support.driven_robot import DrivenRobot
from tests.support.free import free_tcp_port
from tests.support.shared_robot import SharedRobot, Stopped, shared_robot
from tests.support.tcp_link import TcpLink
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.waiting import wait_until

ROUNDS: Final = FEWEST_ROUNDS
QUIET_S: Final = 0.8
"""Longer than any motion may last after a fault."""
STOPS: Final = 200
WATCHERS: Final = 100
LOSS: Final = 0.03
LOSSY_STOPS: Final = 400
"""Both copies of a stop are lost in 0.09 % of the cases: the percentile leaves room for three of them."""


@dataclass(frozen=True, slots=True)
class _Round:
    """A driver who moves a robot, and what is between them; None where it is on the same machine."""

    ground: Ground
    robot: DrivenRobot
    driver: Driver
    link: TcpLink | None = None
    relay: Relay | None = None


def _release(it: _Round) -> float:
    return float(it.driver.ask("release")) / 1e9


def _signal_driver(number: signal.Signals) -> Callable[[_Round], float]:
    return lambda it: _signal(it.driver.process.pid, number)


def _signal_gateway(number: signal.Signals) -> Callable[[_Round], float]:
    return lambda it: _signal(it.robot.gateway.process.pid, number)


def _signal_worker(number: signal.Signals) -> Callable[[_Round], float]:
    return lambda it: _signal(it.ground.worker_pid, number)


def _signal(pid: int, number: signal.Signals) -> float:
    began_s = time.monotonic()
    os.kill(pid, number)
    return began_s


def _cut(it: _Round) -> float:
    assert it.link
    began_s = time.monotonic()
    it.link.cut()
    return began_s


def _lose_answers(it: _Round) -> float:
    assert it.link
    began_s = time.monotonic()
    it.link.down.loss = 1.0
    return began_s


def _fall_silent(it: _Round) -> float:
    assert it.relay
    began_s = time.monotonic()
    it.relay.fall_silent()
    return began_s


@dataclass(frozen=True, slots=True)
class _Fault:
    """What happens, and the promise.

    Args:
        happens: has it happen; returns when, in s of CLOCK_MONOTONIC.
        over: what is between driver and robot.
    """

    what: str
    happens: Callable[[_Round], float]
    bar_ms: float
    over: Literal["nothing", "a link", "a relay"] = "nothing"


FAULTS: Final[Mapping[str, _Fault]] = {
    "release": _Fault("the driver releases", _release, 60),
    "client_killed": _Fault("the driver's program is killed", _signal_driver(signal.SIGKILL), 100),
    "client_frozen": _Fault("the driver's program is frozen", _signal_driver(signal.SIGSTOP), 280),
    "cable_cut": _Fault("the network is cut, round trip 20 ms", _cut, 280, over="a link"),
    "lanes_silent": _Fault("all lanes fall silent and stay open", _fall_silent, 280, over="a relay"),
    "downlink": _Fault("the way to the driver is cut, round trip 20 ms", _lose_answers, 450, over="a link"),
    "gateway_killed": _Fault("the gateway is killed", _signal_gateway(signal.SIGKILL), 60),
    "gateway_frozen": _Fault("the gateway is frozen", _signal_gateway(signal.SIGSTOP), 280),
    "worker_killed": _Fault("the worker of robot-drive is killed", _signal_worker(signal.SIGKILL), 150),
    "worker_frozen": _Fault("the worker of robot-drive is frozen", _signal_worker(signal.SIGSTOP), 150),
}


def rows(ground: Ground, wanted: set[str]) -> list[Row]:
    made = []
    for name, fault in FAULTS.items():
        if f"drive.stop_{name}_ms" in wanted:
            values = [stopped_ms(ground, fault) for _ in range(ROUNDS)]
            what = f"{fault.what}: until the base has zero"
            made.append(_row(name, what, values, fault.bar_ms))
    if "drive.stop_viewer_ms" in wanted:
        what = (
            f"StopRobot by a viewer's login while another person drives, beside {WATCHERS} watchers and one"
            f" that floods: until the base has zero and the viewer knows, 99th percentile of {STOPS}"
        )
        made.append(_row("viewer", what, [viewer_ms(ground) for _ in range(ROUNDS)], 50))
    if "drive.stop_viewer_lossy_ms" in wanted:
        what = (
            f"the same without them, the viewer's link with {LOSS:.0%} loss both ways, round trip 20 ms:"
            f" until the base has zero, 99th percentile of {LOSSY_STOPS}"
        )
        values = [viewer_lossy_ms(ground, seed) for seed in range(1, ROUNDS + 1)]
        made.append(_row("viewer_lossy", what, values, 150))
    return made


def stopped_ms(ground: Ground, fault: _Fault) -> float:
    """Returns how long the base moves after a fault, in ms.

    The last command before it may be 20 ms older (docs/driving.md).
    """
    with ground.robot() as robot:
        match fault.over:
            case "nothing":
                return _stopped_ms(fault, robot.target, ground, robot)
            case "a link":
                with link(robot) as far:
                    return _stopped_ms(fault, far.target, ground, robot, link=far)
            case "a relay":
                with Relay(robot.gateway.port) as relay:
                    target = f"127.0.0.1:{relay.port}"
                    return _stopped_ms(fault, target, ground, robot, relay=relay)


def _stopped_ms(fault: _Fault, target: str, ground: Ground, robot: DrivenRobot, **between: Any) -> float:
    with driver(target, "--stay") as hands:
        wait_until(lambda: robot.base.moves, "the base moves")
        began_s = fault.happens(_Round(ground, robot, hands, **between))
        time.sleep(QUIET_S)
        took_ms = robot.base.stopped_after_s(began_s) * 1000
        # What was frozen, or waits for packets, could not end.
        robot.gateway.process.send_signal(signal.SIGCONT)
        hands.process.kill()
    log(f"{fault.what}: {took_ms:.1f} ms")
    return took_ms


def viewer_ms(ground: Ground, stops: int = STOPS, watchers: int = WATCHERS) -> float:
    """Returns the 99th percentile of the time until the base has zero and the viewer knows."""
    with (
        _shared(ground) as robot,
        program("tests.support.status_siege", robot.target, str(watchers), str(robot.crowd)) as siege,
    ):
        took = _stops(robot, stops)
        siege.kill()
    return _percentile_ms("StopRobot under siege", [max(it.at_base_s, it.answered_s) for it in took])


def viewer_lossy_ms(ground: Ground, seed: int, stops: int = LOSSY_STOPS) -> float:
    """Returns the 99th percentile of the time until the base has zero; the viewer's link loses packets."""
    port = free_tcp_port()
    with link_to(port, LOSS, seed) as far, _shared(ground, port=port, also_at=far.host) as robot:
        took = _stops(robot, stops, far.target)
    _percentile_ms(f"StopRobot with {LOSS:.0%} loss, until the answer", [it.answered_s for it in took])
    return _percentile_ms(f"StopRobot with {LOSS:.0%} loss, at the base", [it.at_base_s for it in took])


@contextmanager
def _shared(ground: Ground, **reached: Any) -> Iterator[SharedRobot]:
    """Yields a robot with a driver's login and a viewer's, by a gateway of its own."""
    with (
        TemporaryDirectory(dir=ground.directory) as name,
        shared_robot(Path(name), ground.base, ground.drive, **reached) as robot,
    ):
        yield robot


def _stops(robot: SharedRobot, count: int, viewers_target: str = "") -> list[Stopped]:
    """Returns stops as `SharedRobot.stops`; begins anew where a stall has cost the driver the session."""

    def once() -> list[Stopped]:
        with no_stall():
            return asyncio.run(robot.stops(count, viewers_target))

    return undisturbed(once)


def _percentile_ms(what: str, took_s: list[float]) -> float:
    found = statistics.quantiles(took_s, n=100)[98] * 1000
    log(f"{what}: median {statistics.median(took_s) * 1000:.1f}, 99 % {found:.1f} ms")
    return found


def _row(name: str, what: str, values: list[float], bar_ms: float) -> Row:
    return Row(name=f"drive.stop_{name}_ms", what=what, unit="ms", values=values, bar=bar_ms, judged="worst")
