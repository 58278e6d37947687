"""robotctl doctor: finds faults between this computer and the robot."""

import typer

from common.errors import ExitCode
from common.findings import exit_code, print_findings
from console.cli.options import with_session
from console.cli.session import Session
from console.client import parse_target
from console.doctor.examination import Examination


@with_session
def doctor(session: Session) -> None:
    """Check name, network, login, gateway, clock and robot, and say what to do about each fault.

    Exit code 0 when nothing is wrong, 1 when something is, 3 when no gateway was reached.
    """
    examination = Examination(parse_target(session.target), session.credentials())
    findings = list(examination.findings())
    print_findings(findings, as_json=session.as_json, out=session.out)
    code = exit_code(findings) if examination.reached else ExitCode.UNREACHABLE
    raise typer.Exit(int(code))
