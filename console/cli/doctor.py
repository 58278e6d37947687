"""robotctl doctor: what keeps this computer and the robot apart."""

import typer

from common.errors import ExitCode
from common.findings import exit_code, print_findings
from console.cli.session import Session, with_session
from console.doctor.examination import examine, reached
from console.target import parse_target


@with_session
def doctor(session: Session) -> None:
    """Check name, network, login, gateway, clock and robot, and say what to do about each fault.

    Exit code 0 when nothing is wrong, 1 when something is, 3 when no gateway was reached.
    """
    findings = list(examine(parse_target(session.target), session.credentials()))
    print_findings(findings, as_json=session.as_json, out=session.out)
    code = exit_code(findings) if reached(findings) else ExitCode.UNREACHABLE
    raise typer.Exit(int(code))
