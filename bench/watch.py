"""100 watchers of the status at 10 Hz: what they cost, whether all are served, and whom they disturb.

The reference of the cost is the same server streaming constant bytes, as many as a status has, as often; both
are counted per answer that arrived. What the others cost a caller who asks for one status after the other is
measured against the same caller alone. Both in turns; callers and gateway share the cores of one machine,
with equal priority.
"""

import json
import statistics
import subprocess
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import grpc

from bench.calling import OWN_CONNECTION
from bench.processes import cpu_seconds, program
from bench.progress import log
from bench.rows import Row
from bench.stack import Stack, running_stack
from bench.watch_load import INTERVAL_MS, SERVICE

WATCHERS = 100
ROUNDS = 5
ROUND_S = 5.0
TURNS = 6
CALLS = 250
PAUSE_S = 0.01
SPENT_AFTER_S = 4.0
"""By then the one that floods has spent what it had saved up, and goes on at the rate that it is given."""
_OTHERS = ("stall", "flood")


@dataclass(frozen=True)
class Cost:
    """Of one round of streams."""

    cpu_us: float
    """CPU time of the server for each answer that arrived."""
    served: float
    """Of the intervals of the round, how many the stream with the fewest answers got, as a share."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    if not names or {"watch.cpu_100", "watch.served_100"} & set(names):
        rows += _streams()
    if not names or "watch.p99_healthy" in names:
        rows.append(_healthy())
    return [row for row in rows if not names or row.name in names]


def _streams() -> list[Row]:
    watched, constant = [], []
    with running_stack() as stack:
        for number in range(ROUNDS):
            watched.append(_cost(stack, WATCHERS, 0))
            constant.append(_cost(stack, 0, WATCHERS))
            log(f"watch: served {watched[-1].served:.3f}, constant bytes {constant[-1].served:.3f}")
            log(f"watch: round {number + 1} of {ROUNDS}")
    return [
        Row(
            name="watch.cpu_100",
            what=f"{WATCHERS} watchers at 10 Hz: CPU of an answer, against streaming as many constant bytes",
            unit="us",
            values=[each.cpu_us for each in watched],
            references=[each.cpu_us for each in constant],
            bar=1.5,
        ),
        Row(
            name="watch.served_100",
            what="the same watchers: intervals with an answer, of the watcher that had the fewest",
            unit="of 1",
            values=[each.served for each in watched],
            judged="worst",
            bar=0.97,
            better="higher",
        ),
    ]


def _cost(stack: Stack, watchers: int, constants: int) -> Cost:
    with _load(stack, watchers, constants) as load:
        time.sleep(0.5)
        before, began_s, cpu_s = _received(load), time.monotonic(), cpu_seconds(stack.pid)
        time.sleep(ROUND_S)
        after, passed_s, spent_s = _received(load), time.monotonic() - began_s, cpu_seconds(stack.pid) - cpu_s
    intervals = passed_s * 1000 / INTERVAL_MS
    answers = [late - early for early, late in zip(before, after, strict=True)]
    return Cost(spent_s / sum(answers) * 1e6, min(answers) / intervals)


def _healthy() -> Row:
    alone, among = [], []
    with running_stack("limited") as stack:
        target = f"127.0.0.1:{stack.port}"
        with grpc.insecure_channel(target, options=OWN_CONNECTION) as channel:
            call: Any = channel.unary_unary(f"{SERVICE}/GetSystemStatus")
            took_ms(call)
            for number in range(TURNS):
                alone.append(p99(took_ms(call)))
                with _load(stack, WATCHERS, 0, *_OTHERS):
                    time.sleep(SPENT_AFTER_S)
                    among.append(p99(took_ms(call)))
                log(f"watch: healthy caller, turn {number + 1} of {TURNS}")
    return Row(
        name="watch.p99_healthy",
        what=f"GetSystemStatus, 99th percentile, among {WATCHERS} watchers, one stalled reader and one that "
        "floods, against alone",
        unit="ms",
        values=among,
        references=alone,
        bar=1.3,
    )


def took_ms(call: Any) -> list[float]:
    """Returns how long each of some calls takes, one after the other with a pause between them."""
    found_ms = []
    for _ in range(CALLS):
        time.sleep(PAUSE_S)
        sent_s = time.perf_counter()
        call(b"")
        found_ms.append((time.perf_counter() - sent_s) * 1000)
    return found_ms


def p99(values: list[float]) -> float:
    """Returns the 99th percentile."""
    return statistics.quantiles(values, n=100)[98]


def _load(
    stack: Stack, watchers: int, constants: int, *others: str
) -> AbstractContextManager[subprocess.Popen[str]]:
    return program("bench.watch_load", str(stack.port), str(watchers), str(constants), *others)


def _received(load: subprocess.Popen[str]) -> list[int]:
    assert load.stdin
    assert load.stdout
    load.stdin.write("\n")
    load.stdin.flush()
    counts: list[int] = json.loads(load.stdout.readline())
    return counts
