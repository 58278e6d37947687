"""Runs benchmarks by name; scripts/bench sets up the virtual environment first."""

import argparse
import importlib
import json
import sys
from pathlib import Path

from rich.console import Console

from bench import report, results

# Each module has `run(names) -> list[Row]`; `names` are the rows asked for, empty for the whole group.
GROUPS = {
    "ros": "bench.ros",
    "status": "bench.status",
    "watch": "bench.watch",
    "events": "bench.events",
    "idle": "bench.idle",
    "cli": "bench.cli",
    "video": "bench.video",
    "viewer": "bench.viewer",
    "monitor": "bench.monitor",
}
# Too long, or too hard on the machine, to be part of a run without names.
ON_REQUEST = {
    "drive": "bench.drive",
    "rec": "bench.rec",
    "export": "bench.export",
    "fleet": "bench.fleet",
    "siege": "bench.siege",
    "soak": "bench.soak",
}
_ALL = GROUPS | ON_REQUEST
_PIPE_WIDTH = 240


def main() -> int:
    """Runs what the command line names.

    Returns:
        0 when every promise is kept, 1 when one is not; argparse exits with 2 for an unknown name.
    """
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"a row or a group ({', '.join(_ALL)}); by default all but {', '.join(ON_REQUEST)}",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write machine, commit, date and rows to FILE"
    )
    parser.add_argument(
        "--publish",
        action="store_true",
        help="replace these rows in docs/benchmarks.json, and generate docs/benchmarks.md from it",
    )
    parser.add_argument(
        "--page", action="store_true", help="only generate docs/benchmarks.md from docs/benchmarks.json"
    )
    arguments = parser.parse_args()
    if arguments.page:
        report.write_page(results.published())
        return 0

    wanted: dict[str, list[str]] = {}
    for name in arguments.names or GROUPS:
        group, _, row = name.partition(".")
        if group not in _ALL:
            parser.error(f"unknown benchmark '{name}': groups are {', '.join(_ALL)}")
        wanted.setdefault(group, [])
        if row:
            wanted[group].append(name)

    on = results.ground()
    rows = [row for group, names in wanted.items() for row in importlib.import_module(_ALL[group]).run(names)]
    run = results.Run(on, tuple(rows))
    # A pipe has no width; a table folded to 80 columns can't be read.
    Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(report.table(rows))
    if arguments.json:
        arguments.json.write_text(json.dumps(run.as_json(), indent=1) + "\n", encoding="utf-8")
    if arguments.publish:
        runs = results.merged(results.published(), run)
        results.write(runs)
        report.write_page(runs)
    return 0 if all(row.ok for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
