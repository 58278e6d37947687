"""What a siege came to, as rows."""

import asyncio
import statistics
from collections import Counter
from typing import Final

from bench.progress import log
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
        log(f"siege: {count} times: {failure}")
    return rows(outcome, size)


def p99_ms(took_ms: list[float]) -> float:
    """Returns the 99th percentile."""
    return statistics.quantiles(took_ms, n=100)[98]


def rows(outcome: Outcome, size: Size) -> list[Row]:
    """Returns what the outcome says, turn by turn; without what the ground does not show."""
    tried, opened, refused = (
        sum(getattr(each, name) for each in outcome.attacks) for name in ("tried", "opened", "refused")
    )
    found = [
        Row(
            name="siege.answered",
            what=f"share of an operator's calls and statuses that were answered, among {size}; these opened "
            f"{opened} connections in {tried} attempts, and had {refused} calls refused",
            unit="of 1",
            values=_answered(outcome),
            bar=1.0,
            better="higher",
            judged="worst",
        ),
        Row(
            name="siege.p99",
            what="GetSystemStatus of the operator at 10 Hz, 99th percentile, besieged against alone",
            unit="ms",
            values=[p99_ms(each.status_ms) for each in outcome.besieged],
            references=[p99_ms(each.status_ms) for each in outcome.alone],
            bar=P99_RATIO,
            judged="worst",
        ),
        Row(
            name="siege.p99_beside",
            what="the same against the operator beside two programs that only take the attackers' core",
            unit="ms",
            values=[p99_ms(each.status_ms) for each in outcome.besieged],
            references=[p99_ms(each.status_ms) for each in outcome.beside],
            bar=None,
        ),
        Row(
            name="siege.login_ms",
            what="a new connection of the operator, to its first status: the slowest of a turn",
            unit="ms",
            values=[max(each.login_ms) for each in outcome.besieged],
            bar=LOGIN_MS,
            judged="worst",
        ),
        Row(
            name="siege.unknown_login_ms",
            what="the same from an address that the gateway has never heard of, attempts that fail included; "
            f"attackers leave after {size.besieged_s:g} s",
            unit="ms",
            values=[max(each.unknown_login_ms) for each in outcome.besieged],
            bar=None,
            judged="worst",
        ),
        Row(
            name="siege.revocation_s",
            what=f"a credential revoked amid the siege, to the end of its {size.streams} streams",
            unit="s",
            values=outcome.revocation_s,
            bar=REVOCATION_S,
            judged="worst",
        ),
        Row(
            name="siege.rss_mib",
            what="resident memory of the gateway, peak of all turns",
            unit="MiB",
            values=[outcome.peaks.resident_mib],
            bar=MEMORY_MIB,
            single=True,
        ),
        Row(
            name="siege.descriptors",
            what="its open descriptors, peak of all turns",
            unit="",
            values=[outcome.peaks.descriptors],
            bar=DESCRIPTORS,
            single=True,
        ),
    ]
    if outcome.closed is not None:
        found.append(
            Row(
                name="siege.closed",
                what="connections that the gateway's guard closed in all turns",
                unit="",
                values=[outcome.closed],
                bar=1,
                better="higher",
                single=True,
            )
        )
    return found


def _answered(outcome: Outcome) -> list[float]:
    """Returns the share of the calls that were answered, by turn: under attack, and before and after it."""
    shares = []
    for turn, besieged in enumerate(outcome.besieged):
        working = (besieged, *outcome.between[2 * turn : 2 * turn + 2])
        shares.append(1 - sum(len(each.failures) for each in working) / sum(each.asked for each in working))
    return shares
