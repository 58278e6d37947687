"""Runs benchmarks by name: `python -m bench [NAME...] [--json FILE]`; scripts/bench sets the ground."""

import argparse
import importlib
import json
import sys
from pathlib import Path

from rich.console import Console

from bench import report
from bench.rows import Row

# Each module has `run(names) -> list[Row]`; `names` are the rows asked for, empty for the whole group.
GROUPS = {
    "ros": "bench.ros",
    "status": "bench.status",
    "watch": "bench.watch",
    "events": "bench.events",
    "idle": "bench.idle",
    "video": "bench.video",
    "viewer": "bench.viewer",
    "monitor": "bench.monitor",
}
# Too long to be part of a run without names.
ON_REQUEST = {"soak": "bench.soak"}
_ALL = GROUPS | ON_REQUEST
_PIPE_WIDTH = 200


def main() -> int:
    """Ends 0 when every promise is kept, 1 when one is not, 2 for an unknown name."""
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"a row or a group ({', '.join(_ALL)}); by default all but {', '.join(ON_REQUEST)}",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here, too")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write them as a page, too")
    parser.add_argument(
        "--with",
        dest="earlier",
        type=_earlier,
        action="append",
        default=[],
        metavar="FILE",
        help="show the rows of another run on this machine with them: what its --json wrote",
    )
    arguments = parser.parse_args()

    wanted: dict[str, list[str]] = {}
    for name in arguments.names or GROUPS:
        group, _, row = name.partition(".")
        if group not in _ALL:
            parser.error(f"unknown benchmark '{name}': groups are {', '.join(_ALL)}")
        wanted.setdefault(group, [])
        if row:
            wanted[group].append(name)

    rows = [row for group, names in wanted.items() for row in importlib.import_module(_ALL[group]).run(names)]
    rows += [row for _, earlier in arguments.earlier for row in earlier]
    # In a pipe nobody knows the width of the screen; a table folded to 80 columns can't be read.
    Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(report.table(rows))
    if arguments.json:
        text = json.dumps({"on": report.machine(), "rows": [row.as_json() for row in rows]}, indent=2)
        arguments.json.write_text(text + "\n", encoding="utf-8")
    if arguments.markdown:
        command = " ".join(
            ("scripts/bench", *arguments.names, *(f"--with {file}" for file, _ in arguments.earlier))
        )
        arguments.markdown.write_text(report.page(rows, command), encoding="utf-8")
    return 0 if all(row.ok for row in rows) else 1


def _earlier(file: str) -> tuple[str, list[Row]]:
    try:
        found = json.loads(Path(file).read_text(encoding="utf-8"))["rows"]
        return file, [Row.from_json(row) for row in found]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise argparse.ArgumentTypeError(f"no rows in {file}: {error}") from error


if __name__ == "__main__":
    sys.exit(main())
