"""Attackers in a process of their own: `python -m bench.siege.attack HOST PORT PLAN`, PLAN as JSON.

Prints "ready", begins with a line on its standard input, ends when that ends, and prints its counts as JSON.
"""

import asyncio
import hashlib
import json
import os
import resource
import sys
from collections.abc import Coroutine, Iterator
from dataclasses import asdict
from typing import Any, Final, NoReturn

import uvloop

from bench.siege.crowd import Crowd
from bench.siege.size import Plan

_BLOCK: Final = bytes(65_536)


async def main(host: str, port: int, plan: Plan) -> None:
    crowd = Crowd((host, port))
    attackers = [asyncio.create_task(each) for each in _attackers(crowd, plan)]
    await asyncio.to_thread(sys.stdin.read)
    for each in attackers:
        each.cancel()
    # One that failed is a defect of this program: then there was no attack to speak of.
    for ended in await asyncio.gather(*attackers, return_exceptions=True):
        if not isinstance(ended, asyncio.CancelledError):
            raise ended
    print(json.dumps(asdict(crowd.counts)), flush=True)


def _attackers(crowd: Crowd, plan: Plan) -> Iterator[Coroutine[Any, Any, Any]]:
    """Source addresses are of 127.0.0.0/8, all of which is this machine; those of another turn are others."""
    yield from (crowd.idle(f"127.2.{plan.turn}.1") for _ in range(plan.idle))
    for address in range(plan.addresses):
        yield from (crowd.idle(f"127.1.{plan.turn}.{1 + address}") for _ in range(plan.idle_per_address))
    yield from (crowd.drip(f"127.3.{plan.turn}.1") for _ in range(plan.slow))
    if plan.burns:
        yield _burn()
    for number in range(plan.flooders):
        yield crowd.flood(f"127.4.{plan.turn}.{1 + number}", plan.tokens[number % len(plan.tokens)])


async def _burn() -> NoReturn:
    while True:
        hashlib.sha256(_BLOCK)
        await asyncio.sleep(0)  # until it is cancelled


def share_one_core() -> None:
    """Leaves the other cores to gateway and operator: attackers come with computers of their own."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


if __name__ == "__main__":
    share_one_core()
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))  # a descriptor for each connection
    print("ready", flush=True)
    sys.stdin.readline()
    uvloop.run(main(sys.argv[1], int(sys.argv[2]), Plan(**json.loads(sys.argv[3]))))
