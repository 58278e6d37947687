"""The rows as a page (docs/benchmarks.md) and as the table on the terminal."""

import os
import platform
from collections.abc import Sequence

from rich.table import Table

from bench.rows import Row

_COLUMNS = ("name", "what", "value", "reference", "ratio", "bar", "ok")


def machine() -> dict[str, str]:
    """What the figures were measured on."""
    return {
        "machine": platform.machine(),
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def table(rows: Sequence[Row]) -> Table:
    """For the terminal."""
    made = Table(*_COLUMNS)
    for row in rows:
        made.add_row(*_cells(row))
    return made


def page(rows: Sequence[Row], command: str) -> str:
    """In Markdown, with the command and the machine."""
    facts = ", ".join(f"{name} {value}" for name, value in machine().items())
    lines = [
        "# Benchmarks",
        "",
        "Each figure and its reference are measured in the same run, in turns. With a reference, the",
        "bar is on the ratio of both; else on the value itself. Made by:",
        "",
        f"    {command}",
        "",
        f"on: {facts}.",
        "",
        "| " + " | ".join(_COLUMNS) + " |",
        "|" + "---|" * len(_COLUMNS),
        *("| " + " | ".join(_cells(row)) + " |" for row in rows),
    ]
    return "\n".join(lines) + "\n"


def _cells(row: Row) -> tuple[str, ...]:
    sign = "<=" if row.better == "lower" else ">="
    return (
        row.name,
        row.what,
        f"{row.value:.4g} {row.unit}",
        "" if row.reference is None else f"{row.reference:.4g} {row.unit}",
        "" if row.ratio is None else f"{row.ratio:.3f}",
        f"{sign} {row.bar:g} {row.unit if row.ratio is None else 'x'}",
        "yes" if row.ok else "NO",
    )
