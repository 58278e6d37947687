"""Fuzzes every parser of the project: `scripts/fuzz [--runs N] [--seed N] [--target NAME]`."""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from fuzz import OUTPUT

_SHORT: Final = 20_000
NAMES: Final = (
    "operators_request",
    "gateways_request",
    "previews_report",
    "robots_answer",
    "configuration",
    "metrics_request",
    "request_id",
    "token",
    "credential_list",
    "login",
    "known_robots",
    "long_list",
    "robots_message",
    "certificate",
    "trial_result",
    "terminal_text",
    "audit_line",
    "admission",
    "video_stream",
    "video_tap",
    "camera_taps_packet",
    "image_message",
    "segment",
    "export_request",
    "hubs_command",
    "gateways_event",
    "gateways_packets",
    "drives_report",
    "recorders_report",
    "bridges_report",
    "hubs_content",
    "gateways_status",
    "receivers_request",
    "kernels_answer",
    "field_path",
    "gateways_refusal",
    "announcement",
)
"""Of `targets.TARGETS`, which only a worker loads (a test compares)."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one target."""

    inputs: int
    seconds: float
    peak_mib: int
    defect: str
    """Empty when there was none; else the worker's last words."""


def main() -> int:
    """Ends 0 when nothing was found, 1 when something was."""
    arguments = _arguments()
    if arguments.input:
        return subprocess.run(_worker(arguments.target, str(arguments.input)), check=False).returncode
    kept = Path(tempfile.mkdtemp(prefix="fuzz-"))
    table = Table("target", "inputs", "seconds", "peak MiB", "found")
    found = False
    names = [arguments.target] if arguments.target else NAMES
    for name, outcome in _outcomes(names, arguments.runs, arguments.seed, kept):
        found |= bool(outcome.defect)
        table.add_row(
            name,
            f"{outcome.inputs:,}",
            f"{outcome.seconds:.0f}",
            str(outcome.peak_mib),
            outcome.defect or "nothing",
        )
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    if found:
        print(f"The inputs are in {kept}. Type: scripts/fuzz --target NAME --input FILE")
    return int(found)


def _outcomes(names: Sequence[str], runs: int, seed: int, kept: Path) -> Iterator[tuple[str, Outcome]]:
    """Yields the outcome of each target, all of them at the end.

    Raises:
        subprocess.CalledProcessError: the worker itself failed.
    """
    worker = subprocess.run(
        _worker(str(kept), str(runs), str(seed), *names), stdout=subprocess.PIPE, text=True, check=True
    )
    for line in worker.stdout.splitlines():
        name, code, seconds = line.split()
        said = (kept / name / OUTPUT).read_text(errors="replace")
        defect = "" if code == "0" else last_words(said)
        inputs, peak_mib = _figure("number_of_executed_units", said), _figure("peak_rss_mb", said)
        yield name, Outcome(inputs, float(seconds), peak_mib, defect)


def _worker(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "fuzz.worker", *arguments]


def _figure(name: str, said: str) -> int:
    match = re.search(rf"stat::{name}:\s+(\d+)", said)
    return int(match[1]) if match else 0


def last_words(said: str) -> str:
    """The exception, else libFuzzer's own line, else whatever came last."""
    lines = [line for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if re.match(r"^(\w+Error|\w+Exception|==\d+== ?ERROR)", line)]
    return (errors or lines[-1:] or ["it ended without a word"])[0][:200]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__)
    parser.add_argument("--runs", type=int, default=_SHORT, help="inputs for each target (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="tries the same inputs again (by default others)")
    parser.add_argument("--target", choices=NAMES, help="this one only")
    parser.add_argument("--input", type=Path, help="try this one input again (with --target)")
    arguments = parser.parse_args()
    if arguments.input and not arguments.target:
        parser.error("--input needs --target")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
