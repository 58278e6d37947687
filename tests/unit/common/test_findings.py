import io
import json

from rich.console import Console

from common.errors import ExitCode
from common.findings import Finding, exit_code, good, note, print_findings, wrong

ALL = (
    good("tcp", "answers"),
    note("encoder", "not proven", "it does not run", "turn it on"),
    wrong("clock", "is [bold]late[/bold]", "logs don't fit", "type this"),
)


def printed(findings: tuple[Finding, ...], *, as_json: bool) -> str:
    out = Console(file=io.StringIO(), width=100, highlight=False, markup=False)
    print_findings(findings, as_json=as_json, out=out)
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def test_only_what_is_wrong_fails() -> None:
    assert exit_code(ALL) is ExitCode.FAILED
    assert exit_code(ALL[:2]) is ExitCode.DONE
    assert exit_code(()) is ExitCode.DONE


def test_people_read_why_and_what_to_do_below_each_finding() -> None:
    lines = [line.split() for line in printed(ALL, as_json=False).splitlines()]
    assert lines[0] == ["good", "tcp", "answers"]
    assert lines[4:8] == [
        ["wrong", "clock", "is", "[bold]late[/bold]"],
        ["why", "logs", "don't", "fit"],
        ["do", "type", "this"],
        ["1", "to", "fix"],
    ]
    assert printed(ALL[:1], as_json=False).splitlines()[-1] == "nothing is wrong"


def test_what_a_finding_quotes_steers_no_terminal() -> None:
    quoting = (wrong("topic.\x1b[2J", "has '\x1b]52;c;aGk=\x07\x9b'", "\u202e", "type\x07 this"),)
    for as_json in (False, True):
        assert all(line.isprintable() for line in printed(quoting, as_json=as_json).split("\n"))


def test_scripts_read_the_same() -> None:
    document = json.loads(printed(ALL, as_json=True))
    assert document["ok"] is False
    assert [each["verdict"] for each in document["findings"]] == ["good", "note", "wrong"]
    assert document["findings"][2] == {
        "check": "clock",
        "verdict": "wrong",
        "what": "is [bold]late[/bold]",
        "why": "logs don't fit",
        "remedy": "type this",
    }
