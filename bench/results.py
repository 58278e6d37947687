"""The published figures: docs/benchmarks.json holds them, docs/benchmarks.md is generated from it."""

import datetime as dt
import json
import os
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

from bench.rows import Row

ROOT: Final = Path(__file__).parent.parent
RESULTS: Final = ROOT / "docs" / "benchmarks.json"


@dataclass(frozen=True, slots=True)
class Run:
    """The rows of one run.

    Args:
        on: where and when they were measured, as `ground` returns it.
        rows: in the order in which they were measured.
    """

    on: dict[str, str]
    rows: tuple[Row, ...]

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Self:
        """Returns the run that `as_json` wrote.

        Raises:
            KeyError, MeasurementError: it holds something else.
        """
        return cls(data["on"], tuple(Row.from_json(row) for row in data["rows"]))

    def as_json(self) -> dict[str, Any]:
        """Returns the run for a JSON file."""
        return {"on": self.on, "rows": [row.as_json() for row in self.rows]}


def ground() -> dict[str, str]:
    """Returns machine, system, Python, commit and date of a run that begins now."""
    kernel = platform.release().split("-")[0]
    return {
        "machine": f"{_processor()}, {os.cpu_count()} cores ({platform.machine()})",
        "system": f"{platform.system()} {kernel}",
        "python": platform.python_version(),
        "commit": _commit(),
        "date": dt.datetime.now(dt.UTC).date().isoformat(),
    }


def published(file: Path = RESULTS) -> list[Run]:
    """Returns the published runs, the oldest first; none where the file does not exist."""
    if not file.exists():
        return []
    return [Run.from_json(run) for run in json.loads(file.read_text(encoding="utf-8"))["runs"]]


def merged(runs: Sequence[Run], newest: Run) -> list[Run]:
    """Returns the runs and the newest one; rows that it measured again are left out of the earlier ones."""
    again = {row.name for row in newest.rows}
    earlier = [replace(run, rows=tuple(row for row in run.rows if row.name not in again)) for run in runs]
    return [*(run for run in earlier if run.rows), newest]


def write(runs: Sequence[Run], file: Path = RESULTS) -> None:
    """Replaces the published runs."""
    text = json.dumps({"runs": [run.as_json() for run in runs]}, indent=1)
    file.write_text(text + "\n", encoding="utf-8")


def _processor() -> str:
    """Returns the processor's name; "unknown processor" where the kernel has none (arm64)."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
        name, _, value = line.partition(":")
        if name.strip() == "model name":
            return value.strip()
    return "unknown processor"


def _commit() -> str:
    """Returns the short commit id, with "+changes" behind it where the checkout has uncommitted ones."""
    described = subprocess.run(
        ["git", "describe", "--always", "--dirty=+changes", "--exclude=*"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    return described.stdout.strip() or "no checkout"
