"""What a siege came to, as rows."""

import asyncio
import statistics
import sys
from collections import Counter
from typing import Final

from bench.rows import Row
from bench.siege.ground import Ground
from bench.siege.rounds import Outcome, besiege
from bench.siege.size import Size

MEMORY_MIB: Final = 192
"""Three quarters of the container's limit (compose.yaml, mem_limit), which also bounds its tmpfs and what the
kernel keeps for its sockets."""
DESCRIPTORS: Final = 1200
"""The connections that gRPC accepts at once (common/rpc.py), and the program's own."""
P99_RATIO: Final = 2.0
REVOCATION_S: Final = 2.0
LOGIN_MS: Final = 2000.0
"""By then the console's client gives up (console/client/options.py)."""


def measured(ground: Ground, size: Size) -> list[Row]:
    """Returns the rows of a siege of this gateway. Those without an answer are named on standard error."""
    outcome = asyncio.run(besiege(ground, size))
    for failure, count in Counter(
        each for record in (*outcome.besieged, *outcome.between) for each in record.failures
    ).items():
        print(f"siege: {count} times: {failure}", file=sys.stderr)
    return rows(outcome, size)


def p99_ms(took_ms: list[float]) -> float:
    """Returns the 99th percentile."""
    return statistics.quantiles(took_ms, n=100)[98]


def rows(outcome: Outcome, size: Size) -> list[Row]:
    """Returns what the outcome says; without what the ground does not show."""
    besieged, alone = outcome.besieged, outcome.alone
    working = (*besieged, *outcome.between)
    calls = sum(each.asked for each in working)
    opened, refused = (sum(getattr(each, name) for each in outcome.attacks) for name in ("opened", "refused"))
    found = [
        Row(
            "siege.answered",
            f"an operator's calls and statuses that came, of {calls}, among {size}; these opened "
            f"{opened} connections and had {refused} calls refused",
            "of 1",
            1 - sum(len(each.failures) for each in working) / calls,
            None,
            1.0,
            "higher",
        ),
        Row(
            "siege.p99",
            "GetSystemStatus of the operator ten times a second, 99th percentile, besieged against alone",
            "ms",
            p99_ms([took for each in besieged for took in each.status_ms]),
            p99_ms([took for each in alone for took in each.status_ms]),
            P99_RATIO,
        ),
        Row(
            "siege.login_ms",
            "a new connection of the operator, to its first status: the slowest",
            "ms",
            max(took for each in besieged for took in each.login_ms),
            None,
            LOGIN_MS,
        ),
        Row(
            "siege.revocation_s",
            f"a credential revoked amid the siege, to the end of its {size.streams} streams: the slowest",
            "s",
            max(outcome.revocation_s),
            None,
            REVOCATION_S,
        ),
        Row(
            "siege.rss_mib",
            "resident memory of the gateway, peak",
            "MiB",
            outcome.peaks.resident_mib,
            None,
            MEMORY_MIB,
        ),
        Row(
            "siege.descriptors",
            "its open descriptors, peak",
            "",
            outcome.peaks.descriptors,
            None,
            DESCRIPTORS,
        ),
    ]
    if outcome.closed is not None:
        closed = "connections that the gateway's guard closed"
        found.append(Row("siege.closed", closed, "", outcome.closed, None, 1, "higher"))
    return found
