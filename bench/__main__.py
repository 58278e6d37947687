"""Runs benchmarks by name: `python -m bench [NAME...] [--json FILE]`; scripts/bench sets the ground."""

import argparse
import importlib
import json
import platform
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.rows import Row

# Each module has `run(names) -> list[Row]`; `names` are the rows asked for, empty for the whole group.
GROUPS = {
    "ros": "bench.ros",
    "status": "bench.status",
    "idle": "bench.idle",
    "video": "bench.video",
}


def main() -> int:
    """Ends 0 when every promise is kept, 1 when one is not, 2 for an unknown name."""
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"a row or a group ({', '.join(GROUPS)}); all by default"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here, too")
    arguments = parser.parse_args()

    wanted: dict[str, list[str]] = {}
    for name in arguments.names or GROUPS:
        group, _, row = name.partition(".")
        if group not in GROUPS:
            parser.error(f"unknown benchmark '{name}': groups are {', '.join(GROUPS)}")
        wanted.setdefault(group, [])
        if row:
            wanted[group].append(name)

    rows = [
        row for group, names in wanted.items() for row in importlib.import_module(GROUPS[group]).run(names)
    ]
    Console().print(_table(rows))
    if arguments.json:
        machine = {
            "machine": platform.machine(),
            "system": platform.platform(),
            "python": platform.python_version(),
        }
        text = json.dumps({"on": machine, "rows": [row.as_json() for row in rows]}, indent=2)
        arguments.json.write_text(text + "\n", encoding="utf-8")
    return 0 if all(row.ok for row in rows) else 1


def _table(rows: list[Row]) -> Table:
    table = Table("name", "what", "value", "reference", "ratio", "bar", "ok")
    for row in rows:
        reference = "" if row.reference is None else f"{row.reference:.4g} {row.unit}"
        ratio = "" if row.ratio is None else f"{row.ratio:.3f}"
        sign = "<=" if row.better == "lower" else ">="
        bar = f"{sign} {row.bar:g} {row.unit if row.ratio is None else 'x'}"
        value = f"{row.value:.4g} {row.unit}"
        table.add_row(row.name, row.what, value, reference, ratio, bar, "yes" if row.ok else "NO")
    return table


if __name__ == "__main__":
    sys.exit(main())
