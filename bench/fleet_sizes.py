"""The table of sizes in docs/fleet.md, from the published rows of `bench.fleet.cost`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from bench.results import ROOT, Run

if TYPE_CHECKING:
    from bench.rows import Row

DOCUMENT: Final = ROOT / "docs" / "fleet.md"
SIZES: Final = (10, 100, 1000)
"""Robots."""
EVENT_BYTES: Final = 200
EVENT_EVERY_S: Final = 60.0
BEGIN: Final = (
    "<!-- sizes: scripts/bench --page writes what is between these lines, from benchmarks.json -->\n"
)
END: Final = "<!-- end of sizes -->\n"
_PER_S: Final = 1 + 1 / EVENT_EVERY_S
"""Messages of a robot: a state each second, and its events."""
_KEPT_S: Final = 30 * 86_400.0
_USE: Final = {
    10: "one node on any small computer",
    100: "one node, or three for what has to go on",
    1000: "three nodes with an SSD each; more than 8 GiB for events",
}
_HEAD: Final = (
    "| robots | messages/s | CPU of a node | memory of a node | events of 30 days on its disk | use |"
)


def table(runs: Sequence[Run]) -> str | None:
    """Returns the text between the two lines; None where not all of its rows are published.

    Args:
        runs: the published ones.
    """
    measured = {row.name: (row, run) for run in runs for row in run.rows}
    names = [f"fleet.hub_{robots}_{figure}" for robots in SIZES for figure in ("cpu", "mib")]
    names.append("fleet.event_disk_bytes")
    if not all(name in measured for name in names):
        return None
    found: dict[str, Row] = {name: measured[name][0] for name in names}
    on = [measured[name][1].on for name in names]
    where = "; ".join(dict.fromkeys(f"{each.date}, commit {each.commit}, {each.machine}" for each in on))
    lines = [
        f"Measured by `scripts/bench fleet` ({where}).",
        "",
        _HEAD,
        "|" + "---|" * _HEAD.count(" | ") + "---|",
    ]
    for robots in SIZES:
        cpu, mib = found[f"fleet.hub_{robots}_cpu"].value, found[f"fleet.hub_{robots}_mib"].value
        disk_gb = robots * _KEPT_S / EVENT_EVERY_S * found["fleet.event_disk_bytes"].value / 1e9
        lines.append(
            f"| {robots} | {robots * _PER_S:.0f} | {cpu:.2g} % of a core | {mib:.0f} MiB | {disk_gb:.1f} GB"
            f" | {_USE[robots]} |"
        )
    return "\n".join(lines) + "\n"


def write(runs: Sequence[Run], file: Path = DOCUMENT) -> None:
    """Replaces the table in docs/fleet.md; leaves it as it is where not all of its rows are published.

    Args:
        runs: the published ones.
        file: the document.

    Raises:
        ValueError: the document lacks one of the two lines.
    """
    made = table(runs)
    if made is not None:
        before, _, after = _split(file.read_text(encoding="utf-8"))
        file.write_text(f"{before}{BEGIN}{made}{END}{after}", encoding="utf-8")


def written(file: Path = DOCUMENT) -> str:
    """Returns what the document has between the two lines; raises as `write`."""
    return _split(file.read_text(encoding="utf-8"))[1]


def _split(text: str) -> tuple[str, str, str]:
    before, begun, rest = text.partition(BEGIN)
    between, ended, after = rest.partition(END)
    if not begun or not ended:
        raise ValueError(f"the document has no lines {BEGIN.strip()} and {END.strip()}")
    return before, between, after
