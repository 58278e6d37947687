"""Findings of the doctor commands: one data type, one table and one JSON document for all of them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Final, NoReturn

import typer

from common.errors import ExitCode
from common.printable import escaped, printable_lines

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

# rich is imported late: programs that serve pass findings on, and print none.


class Verdict(Enum):
    """Outcome of a check."""

    GOOD = "good"
    NOTE = "note"
    """Noteworthy but not an error, or not checkable now; then the remedy says how it becomes checkable."""
    WRONG = "wrong"


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check.

    Args:
        check: short, stable name of the check, for programs: "tcp", "source.odometry".
        verdict: its outcome.
        what: what was found.
        why: why it matters; empty for a good outcome.
        remedy: what to do or to type; empty if nothing is to be done.
    """

    check: str
    verdict: Verdict
    what: str
    why: str = ""
    remedy: str = ""


def good(check: str, what: str) -> Finding:
    """Returns a finding that needs no action."""
    return Finding(check, Verdict.GOOD, what)


def note(check: str, what: str, why: str = "", remedy: str = "") -> Finding:
    """Returns a finding that is noteworthy but not an error."""
    return Finding(check, Verdict.NOTE, what, why, remedy)


def wrong(check: str, what: str, why: str, remedy: str) -> Finding:
    """Returns an error finding, with its consequence and remedy."""
    return Finding(check, Verdict.WRONG, what, why, remedy)


def exit_code(findings: Iterable[Finding]) -> ExitCode:
    """Returns FAILED if any verdict is WRONG, else DONE."""
    return ExitCode.FAILED if any(each.verdict is Verdict.WRONG for each in findings) else ExitCode.DONE


def findings_json(findings: Sequence[Finding]) -> dict[str, Any]:
    """Returns the JSON document that `--json` prints."""
    return {
        "ok": exit_code(findings) is ExitCode.DONE,
        "findings": [asdict(each) | {"verdict": each.verdict.value} for each in findings],
    }


def print_findings(findings: Sequence[Finding], *, as_json: bool, out: "Console") -> None:
    """Prints a JSON document, or a row per finding with consequence and remedy below it."""
    if as_json:
        print(escaped(json.dumps(findings_json(findings), indent=2, ensure_ascii=False)), file=out.file)
        return
    from rich.text import Text  # noqa: PLC0415

    out.print(_table(findings))
    count = sum(each.verdict is Verdict.WRONG for each in findings)
    out.print(Text("nothing is wrong" if count == 0 else f"{count} to fix", style="bold"))


def end_with_findings(findings: Iterable[Finding], *, as_json: bool) -> NoReturn:
    """Prints what a doctor has found on standard output, and ends the command with the exit code."""
    from rich.console import Console  # noqa: PLC0415

    found = list(findings)
    print_findings(found, as_json=as_json, out=Console(highlight=False, markup=False, emoji=False))
    raise typer.Exit(int(exit_code(found)))


_STYLES: Final = {Verdict.GOOD: "green", Verdict.NOTE: "yellow", Verdict.WRONG: "bold red"}


def _table(findings: Sequence[Finding]) -> "Table":
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for each in findings:
        table.add_row(
            Text(each.verdict.value, style=_STYLES[each.verdict]), _text(each.check), _text(each.what)
        )
        for label, text in (("why", each.why), ("do", each.remedy)):
            if text:
                table.add_row("", Text(label, style="dim"), _text(text))
    return table


def _text(text: str) -> "Text":
    """Returns a cell. What a finding quotes of the graph, of a file or of another program can be anything."""
    from rich.text import Text  # noqa: PLC0415

    return Text(printable_lines(text))
