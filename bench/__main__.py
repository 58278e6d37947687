"""Runs benchmarks by name; scripts/bench sets up the virtual environment first."""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from bench import catalogue, fleet_sizes, report, results
from bench.catalogue import NAMES, Part
from bench.progress import log
from bench.results import Run
from bench.running import measured

_PIPE_WIDTH = 240


def main() -> int:
    """Runs what the command line names.

    Returns:
        0 when every promise is kept; 1 when one is not, or rows could not be measured; argparse exits with 2
        for an unknown name.
    """
    parser = _parser()
    arguments = parser.parse_args()
    if arguments.page:
        _write_documents()
        return 0
    try:
        plan = catalogue.chosen(arguments.names)
    except ValueError as error:
        parser.error(str(error))
    if arguments.publish and results.commit().endswith(results.CHANGED):
        parser.error("the checkout has changes: commit them first, so that the figures name a commit")
    if arguments.missing:
        plan = _without_published(plan)
    _announce(plan)
    run = _measure(plan, publish=arguments.publish)
    # A pipe has no width; a table folded to 80 columns can't be read.
    Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(report.table(run.rows))
    if arguments.json:
        arguments.json.write_text(json.dumps(run.as_json(), indent=1) + "\n", encoding="utf-8")
    wanted = [name for names in plan.values() for name in names]
    measured_names = {row.name for row in run.rows}
    if lacking := [name for name in wanted if name not in measured_names]:
        log(f"not measured, see above: {' '.join(lacking)}")
    return 0 if not lacking and all(row.ok for row in run.rows) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"a row or a group ({', '.join(catalogue.GROUPS)});"
        f" by default all but {', '.join(catalogue.ON_REQUEST)}",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write machine, commit, date and rows to FILE"
    )
    parser.add_argument(
        "--publish",
        action="store_true",
        help="replace these rows in docs/benchmarks.json, and generate docs/benchmarks.md and the table of"
        " sizes in docs/fleet.md from it, as soon as they are measured",
    )
    parser.add_argument(
        "--missing",
        action="store_true",
        help="leave out the rows that are published already, of this commit on this machine",
    )
    parser.add_argument(
        "--page", action="store_true", help="only generate these documents from docs/benchmarks.json"
    )
    return parser


def _without_published(plan: Mapping[Part, Sequence[str]]) -> dict[Part, tuple[str, ...]]:
    """Returns the plan without rows that are published of this commit on this machine."""
    here = results.Conditions.now()
    done = {row.name for run in results.published() if run.on.same_subject(here) for row in run.rows}
    left = {part: tuple(name for name in names if name not in done) for part, names in plan.items()}
    return {part: names for part, names in left.items() if names}


def _announce(plan: Mapping[Part, Sequence[str]]) -> None:
    """Logs how long it will take."""
    minutes: dict[str, float] = {}
    for part in plan:
        minutes[part.group] = minutes.get(part.group, 0.0) + part.minutes
    for group, each in minutes.items():
        log(f"{group}: about {each:.0f} min")
    if len(minutes) > 1:
        log(f"all of it: about {sum(minutes.values()):.0f} min")


def _measure(plan: Mapping[Part, Sequence[str]], *, publish: bool) -> Run:
    """Measures one part after the other; what fails is logged, and the others go on."""
    run = Run(results.Conditions.now(), ())
    for part, names in plan.items():
        on = results.Conditions.now()
        if not on.same_subject(run.on):
            # Each part is a new process: it would measure something else than those before it.
            log(f"{run.on.commit} has become {on.commit}: the rest is not measured")
            break
        log(f"{part.module}: about {part.minutes:g} min; before it, programs waited {on.busy_percent} %")
        newer = Run(on, tuple(measured(part, names)))
        for row in newer.rows:
            log(f"{row.name}: {report.summary(row)}")
        run = run.with_newer(newer, NAMES)
        if publish and newer.rows:
            results.write(results.merged(results.published(), newer, NAMES))
            _write_documents()
    return run


def _write_documents() -> None:
    """Generates what documents have of the published figures."""
    # From the file, so that they and the file can't differ in a rounded digit.
    published = results.published()
    report.write_page(published)
    fleet_sizes.write(published)


if __name__ == "__main__":
    sys.exit(main())
