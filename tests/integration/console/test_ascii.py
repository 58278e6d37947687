"""robotctl where the terminal's encoding is ASCII."""

import subprocess

import pytest

from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_WARNING
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment


@pytest.mark.parametrize("command", ["doctor", "status"])
def test_a_degree_sign_ends_no_command(command: str) -> None:
    double = GatewayDouble()
    double.status.faults.add(
        id="platform.temperature", active=True, severity=FAULT_SEVERITY_WARNING, message="hot: 85 °C or more"
    )
    with serving(double) as port:
        ran = subprocess.run(
            [ROBOTCTL, command, "--target", f"127.0.0.1:{port}"],
            capture_output=True,
            timeout=ENDS_WITHIN_S,
            env=environment(PYTHONIOENCODING="ascii:strict"),
            check=False,
        )
    assert b"Traceback" not in ran.stderr
    assert b"hot: 85 ?C or more" in ran.stdout
