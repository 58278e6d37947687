"""What a soak reads of a program, and what the readings say about growth.

Memory and descriptors first grow to a level that depends on the pace, and move about it: the second tenth of
the rounds is compared with the last one, the lowest figure of each. A leak raises that one, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from bench.processes import resident_mib
from bench.rows import Row

FEWEST_ROUNDS: Final = 100
"""A tenth of them is a window."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Of a program, between two rounds."""

    resident_mib: float
    descriptors: int

    @classmethod
    def of(cls, pid: int) -> Self:
        """Reads a process."""
        return cls(resident_mib(pid), len(list(Path(f"/proc/{pid}/fd").iterdir())))


def judge(readings: Sequence[Reading], name: str, program: str, rounds: str) -> list[Row]:
    """Returns the rows on memory and descriptors.

    Args:
        readings: in the order in which they were taken, at least FEWEST_ROUNDS.
        name: beginning of the rows' names.
        program: the one that was read, for people.
        rounds: what a round was, and for how long they went on.
    """
    tenth = len(readings) // 10
    early, late = readings[tenth : 2 * tenth], readings[-tenth:]
    grown_mib = min(r.resident_mib for r in late) - min(r.resident_mib for r in early)
    more = min(r.descriptors for r in late) - min(r.descriptors for r in early)
    return [
        Row(
            name=f"{name}rss_growth_mib",
            what=f"resident memory of {program}, over {len(readings)} rounds of {rounds}",
            unit="MiB",
            values=[grown_mib],
            bar=5,
            single=True,
        ),
        Row(
            name=f"{name}fds_growth",
            what="its file descriptors, over the same rounds",
            unit="",
            values=[more],
            bar=0,
            single=True,
        ),
    ]
