"""`robotctl record` against a gateway that is a process."""

import json
from typing import TYPE_CHECKING, Any

from tests.support.gateway_program import GatewayProgram
from tests.support.robotctl import robotctl

if TYPE_CHECKING:
    import subprocess


def record(gateway: GatewayProgram, *words: str) -> "subprocess.CompletedProcess[str]":
    """Runs the command to its end."""
    return robotctl("--target", f"127.0.0.1:{gateway.port}", "record", *words)


def printed(gateway: GatewayProgram, *words: str) -> Any:
    """Returns what the command prints with --json; it must succeed."""
    ran = record(gateway, *words, "--json")
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)
