"""What a doctor found: what is so, why it matters, what to type. One shape for every doctor."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from common.errors import ExitCode


class Verdict(Enum):
    """How a check ended."""

    GOOD = "good"
    NOTE = "note"
    """Worth knowing, and not wrong; or it could not be looked at, and the finding says how it can."""
    WRONG = "wrong"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Args:
        check: what was looked at, short and stable, for programs: "tcp", "source.odometry".
        verdict: how it ended.
        what: what was found.
        why: why it matters. Empty where all is good.
        remedy: what to do or to type. Empty where there is nothing to do.
    """

    check: str
    verdict: Verdict
    what: str
    why: str = ""
    remedy: str = ""


def good(check: str, what: str) -> Finding:
    """Nothing to do."""
    return Finding(check, Verdict.GOOD, what)


def note(check: str, what: str, why: str = "", remedy: str = "") -> Finding:
    """Worth knowing."""
    return Finding(check, Verdict.NOTE, what, why, remedy)


def wrong(check: str, what: str, why: str, remedy: str) -> Finding:
    """Something to mend."""
    return Finding(check, Verdict.WRONG, what, why, remedy)


def exit_code(findings: Iterable[Finding]) -> ExitCode:
    """DONE when nothing is wrong, else FAILED."""
    return ExitCode.FAILED if any(each.verdict is Verdict.WRONG for each in findings) else ExitCode.DONE


def findings_json(findings: Sequence[Finding]) -> dict[str, Any]:
    """As scripts read it."""
    return {
        "ok": exit_code(findings) is ExitCode.DONE,
        "findings": [asdict(each) | {"verdict": each.verdict.value} for each in findings],
    }


def print_findings(findings: Sequence[Finding], *, as_json: bool, out: Console) -> None:
    """On standard output: a JSON document, or a line per finding with why and what to type below it."""
    if as_json:
        print(json.dumps(findings_json(findings), indent=2, ensure_ascii=False), file=out.file)
        return
    out.print(_table(findings))
    count = sum(each.verdict is Verdict.WRONG for each in findings)
    out.print(Text("nothing is wrong" if count == 0 else f"{count} to mend", style="bold"))


_STYLES: Final = {Verdict.GOOD: "green", Verdict.NOTE: "yellow", Verdict.WRONG: "bold red"}


def _table(findings: Sequence[Finding]) -> Table:
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for each in findings:
        table.add_row(
            Text(each.verdict.value, style=_STYLES[each.verdict]), Text(each.check), Text(each.what)
        )
        for label, text in (("why", each.why), ("do", each.remedy)):
            if text:
                table.add_row("", Text(label, style="dim"), Text(text))
    return table
