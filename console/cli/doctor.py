"""robotctl doctor: what keeps this computer and the robot apart."""

import os
import sys
from dataclasses import replace
from typing import Final

import typer

from common.errors import ExitCode, UserError
from common.findings import exit_code, print_findings
from console.cli.session import Session, with_session
from console.cli.typed_options import typed_options
from console.doctor.examination import examine, reached
from console.target import parse_target

_SEARCH_S: Final = 2.5
"""The second query is sent after 1 s; a responder need not answer the first (RFC 6762 6)."""
_MOST_NEARBY: Final = 8


@with_session
def doctor(session: Session) -> None:
    """Check name, network, login, gateway, clock and robot, and say what to do about each fault.

    Exit code 0 when nothing is wrong, 1 when something is, 3 when no gateway was reached.
    """
    typed = typed_options(sys.argv[1:])
    findings = [
        replace(each, remedy=typed.repeated_in(each.remedy))
        for each in examine(parse_target(session.target), session.credentials(), nearby=_nearby)
    ]
    print_findings(findings, as_json=session.as_json, out=session.out)
    code = exit_code(findings) if reached(findings) else ExitCode.UNREACHABLE
    raise typer.Exit(int(code))


def _nearby() -> list[tuple[str, str]]:
    # Late: its library takes long to import, and is needed only where no robot is reached.
    from console.robots import discovery  # noqa: PLC0415

    try:
        found, _ = discovery.discover(_SEARCH_S, discovery.addresses_in(os.environ))
    except UserError:
        # The findings say already that the network does not lead to the robot.
        return []
    return [(each.name, each.target) for each in found[:_MOST_NEARBY]]
