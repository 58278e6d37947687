"""What a soak reads of a program, and what the readings say about growth.

Memory, descriptors and threads first grow to a level that depends on the pace, and move about it: the second
tenth of the rounds is compared with the last one, the lowest figure of each. A leak raises that one, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from bench.processes import resident_mib, shared_mib
from bench.rows import Row

FEWEST_ROUNDS: Final = 100
"""A tenth of them is a window."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Of a program, between two rounds.

    Attributes:
        logged_bytes: since its start; 0 where its log is not known.
        shared_mib: the part of the resident memory that other processes may have as well.
    """

    resident_mib: float
    descriptors: int
    threads: int = 0
    logged_bytes: int = 0
    shared_mib: float = 0.0

    @classmethod
    def of(cls, pid: int, log: Path | None = None) -> Self:
        """Reads a process, and the size of its log."""
        descriptors, threads = (len(list(Path(f"/proc/{pid}/{each}").iterdir())) for each in ("fd", "task"))
        logged_bytes = log.stat().st_size if log else 0
        return cls(resident_mib(pid), descriptors, threads, logged_bytes, shared_mib(pid))


@dataclass(frozen=True, slots=True)
class Growth:
    """Of a program, from the second tenth of its rounds to the last.

    Attributes:
        logged: bytes of the log in the last tenth by those in the second; 1 where neither has any.
    """

    resident_mib: float
    descriptors: int
    threads: int
    logged: float

    @classmethod
    def over(cls, readings: Sequence[Reading]) -> Self:
        """Returns that of readings in the order in which they were taken, at least FEWEST_ROUNDS."""
        tenth = len(readings) // 10
        early, late = readings[tenth : 2 * tenth], readings[-tenth:]
        logged = [part[-1].logged_bytes - part[0].logged_bytes for part in (early, late)]
        return cls(
            min(r.resident_mib for r in late) - min(r.resident_mib for r in early),
            min(r.descriptors for r in late) - min(r.descriptors for r in early),
            min(r.threads for r in late) - min(r.threads for r in early),
            (logged[1] + 1) / (logged[0] + 1),
        )


def judge(readings: Sequence[Reading], name: str, program: str, rounds: str) -> list[Row]:
    """Returns the rows on memory and descriptors.

    Args:
        readings: in the order in which they were taken, at least FEWEST_ROUNDS.
        name: beginning of the rows' names.
        program: the one that was read, for people.
        rounds: what a round was, and for how long they went on.
    """
    growth = Growth.over(readings)
    return [
        Row(
            name=f"{name}rss_growth_mib",
            what=f"resident memory of {program}, over {len(readings)} rounds of {rounds}",
            unit="MiB",
            values=[growth.resident_mib],
            bar=5,
            single=True,
        ),
        Row(
            name=f"{name}fds_growth",
            what="its file descriptors, over the same rounds",
            unit="",
            values=[growth.descriptors],
            bar=0,
            single=True,
        ),
    ]


def judge_together(
    readings: Sequence[Mapping[str, Reading]], failed_rounds: int, name: str, rounds: str
) -> list[Row]:
    """Returns the rows on several programs: each is judged by the one that grew most.

    Args:
        readings: by program, in the order in which they were taken, at least FEWEST_ROUNDS.
        failed_rounds: in which an operator did not get what was asked for.
        name: beginning of the rows' names.
        rounds: what a round was, and for how long they went on.
    """
    grown = {program: Growth.over([each[program] for each in readings]) for program in readings[0]}
    over = f"over {len(readings)} rounds of {rounds}"
    figures = (
        ("rss_growth_mib", "resident memory", "MiB", 5, {p: g.resident_mib for p, g in grown.items()}),
        ("fds_growth", "file descriptors", "", 0, {p: g.descriptors for p, g in grown.items()}),
        ("threads_growth", "threads", "", 0, {p: g.threads for p, g in grown.items()}),
        (
            "log_growth",
            "bytes logged in a tenth of the rounds",
            "x",
            1.5,
            {p: g.logged for p, g in grown.items()},
        ),
    )
    made = []
    for figure, what, unit, bar, by_program in figures:
        most = max(by_program, key=lambda program: by_program[program])
        made.append(
            Row(
                name=f"{name}{figure}",
                what=f"{what} of the program that grew most ({most}), {over}",
                unit=unit,
                values=[by_program[most]],
                bar=bar,
                single=True,
            )
        )
    made.append(
        Row(
            name=f"{name}failed_rounds",
            what="of these rounds, those in which an operator did not get what was asked for",
            unit="",
            values=[failed_rounds],
            bar=0,
            single=True,
        )
    )
    return made
