"""The published figures: docs/benchmarks.json holds them, docs/benchmarks.md is generated from it."""

import datetime as dt
import json
import os
import platform
import subprocess
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

from bench.rows import Row

ROOT: Final = Path(__file__).parent.parent
RESULTS: Final = ROOT / "docs" / "benchmarks.json"
CHANGED: Final = "+changes"
"""Behind the commit of a checkout that has uncommitted changes."""
_OTHER_FILES: Final = ("--", ".", *(f":!{path}" for path in ("docs", "*.md", "bench/remarks.py")))
"""Paths for git: to publish figures, and to say something of them, changes nothing that is measured."""
_PRESSURE: Final = Path("/proc/pressure/cpu")
_WATCHED_S: Final = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """Where and when rows were measured.

    Args:
        machine: processor and number of cores.
        system: kernel.
        python: version.
        commit: of the checkout.
        date: of the measuring, or "FIRST to LAST", in UTC.
        busy_percent: share of the time in which a program waited for a processor just before; None where the
            kernel does not say.
    """

    machine: str
    system: str
    python: str
    commit: str
    date: str
    busy_percent: float | None

    @classmethod
    def now(cls) -> Self:
        """Returns those of a measurement that begins now. Takes some seconds, for `busy_percent`."""
        return cls(
            machine=f"{_processor()}, {os.cpu_count()} cores ({platform.machine()})",
            system=f"{platform.system()} {platform.release().split('-')[0]}",
            python=platform.python_version(),
            commit=commit(),
            date=dt.datetime.now(dt.UTC).date().isoformat(),
            busy_percent=_busy_percent(),
        )

    def same_subject(self, other: "Conditions") -> bool:
        """Whether the same commit was measured on the same machine, at whatever time."""
        return self == replace(other, date=self.date, busy_percent=self.busy_percent)

    def joined(self, other: "Conditions") -> "Conditions":
        """Returns those of rows of which some were measured later."""
        dates = sorted({*self.date.split(" to "), *other.date.split(" to ")})
        busy = [one for one in (self.busy_percent, other.busy_percent) if one is not None]
        return replace(
            self,
            date=dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}",
            busy_percent=max(busy, default=None),
        )


@dataclass(frozen=True, slots=True)
class Run:
    """Rows that were measured of one commit on one machine."""

    on: Conditions
    rows: tuple[Row, ...]

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Self:
        """Returns the run that `as_json` wrote.

        Raises:
            KeyError, TypeError, MeasurementError: it holds something else.
        """
        return cls(Conditions(**data["on"]), tuple(Row.from_json(row) for row in data["rows"]))

    def as_json(self) -> dict[str, Any]:
        """Returns the run for a JSON file."""
        return {"on": asdict(self.on), "rows": [row.as_json() for row in self.rows]}

    def with_newer(self, newer: "Run", order: Sequence[str]) -> "Run":
        """Returns this run with rows of the same commit that were measured later; theirs count.

        Args:
            newer: the rows, on the same machine.
            order: names of all rows that there are.
        """
        by_name = {row.name: row for row in (*self.rows, *newer.rows)}
        rows = tuple(sorted(by_name.values(), key=lambda row: order.index(row.name)))
        return Run(self.on.joined(newer.on), rows)


def published(file: Path = RESULTS) -> list[Run]:
    """Returns the published runs, the oldest first; none where the file does not exist."""
    if not file.exists():
        return []
    return [Run.from_json(run) for run in json.loads(file.read_text(encoding="utf-8"))["runs"]]


def merged(runs: Sequence[Run], newest: Run, order: Sequence[str]) -> list[Run]:
    """Returns the runs with a newer one.

    Rows that it measured again are left out of the earlier ones, and so are those that no benchmark has any
    more. What was measured of the same commit on the same machine is one run.

    Args:
        runs: the oldest first.
        newest: the newer one.
        order: names of all rows that there are, in the order in which a run has them.
    """
    kept = set(order) - {row.name for row in newest.rows}
    earlier = [replace(run, rows=tuple(row for row in run.rows if row.name in kept)) for run in runs]
    for run in earlier:
        if run.on.same_subject(newest.on):
            newest = run.with_newer(newest, order)
    return [*(run for run in earlier if run.rows and not run.on.same_subject(newest.on)), newest]


def write(runs: Sequence[Run], file: Path = RESULTS) -> None:
    """Replaces the published runs."""
    text = json.dumps({"runs": [run.as_json() for run in runs]}, indent=1)
    file.write_text(text + "\n", encoding="utf-8")


def write_rows(rows: Sequence[Row], file: Path) -> None:
    """Writes rows for `read_rows`."""
    file.write_text(json.dumps([row.as_json() for row in rows]), encoding="utf-8")


def read_rows(file: Path) -> list[Row]:
    """Returns the rows of a file by `write_rows`."""
    return [Row.from_json(row) for row in json.loads(file.read_text(encoding="utf-8"))]


def commit(root: Path = ROOT) -> str:
    """Returns the short ID of the newest commit that changed more than figures and what is said of them.

    CHANGED is behind it where the checkout has uncommitted changes besides these.
    """
    newest = _git(root, "log", "-1", "--format=%h", *_OTHER_FILES)
    if not newest:
        return "no checkout"
    changes = _git(root, "status", "--porcelain", "--untracked-files=no", *_OTHER_FILES)
    return newest + (CHANGED if changes else "")


def _git(root: Path, *arguments: str) -> str:
    """Returns what git prints; nothing where this is no checkout."""
    command = ["git", *arguments]
    return subprocess.run(command, cwd=root, stdout=subprocess.PIPE, text=True, check=False).stdout.strip()


def _processor() -> str:
    """Returns the processor's name; "unknown processor" where the kernel has none (arm64)."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
        name, _, value = line.partition(":")
        if name.strip() == "model name":
            return value.strip()
    return "unknown processor"


def _busy_percent() -> float | None:
    """Returns in which share of the coming seconds a program waits for a processor (the kernel's PSI)."""
    before_us, began_s = _waited_us(), time.monotonic()
    if before_us is None:
        return None
    time.sleep(_WATCHED_S)
    after_us = _waited_us()
    assert after_us is not None
    return round((after_us - before_us) / (time.monotonic() - began_s) / 1e4, 1)


def _waited_us() -> int | None:
    """Returns how long at least one program has waited for a processor; None for a kernel without PSI."""
    try:
        some = _PRESSURE.read_text(encoding="ascii").splitlines()[0]
    except OSError:
        return None
    return int(some.rpartition("total=")[2])
