"""What the real program prints with --json, held to docs/robotctl.md: each key, and each value's type."""

import json
import subprocess
from typing import Any

import grpc
import pytest

from tests.support.filled import fill
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble
from tests.support.robotctl import ROBOTCTL, environment, only_line, robotctl
from tests.support.robotctl_docs import documented, holds


@pytest.fixture(params=["everything", "nothing"])
def known(request: pytest.FixtureRequest, double: GatewayDouble) -> str:
    """How much the robot knows: each field set, or none."""
    for message in (double.status, double.overlay, double.info):
        message.Clear()
        if request.param == "everything":
            fill(message)
    # Not just any text: an object, or nothing.
    double.info.configuration_json = '{"name": "lab-1"}' if request.param == "everything" else ""
    return str(request.param)


@pytest.mark.parametrize(
    ("section", "arguments"),
    [
        ("status --json", ("status",)),
        ("overlay --json", ("overlay",)),
        ("info --json", ("info",)),
        ("watch --json", ("watch", "--count", "1")),
        ("preview on|off --json", ("preview", "on", "--wait", "0")),
        ("preview on|off --json", ("preview", "off", "--wait", "0")),
    ],
)
def test_json_has_exactly_the_documented_keys(
    target: str, known: str, section: str, arguments: tuple[str, ...]
) -> None:
    done = robotctl("--target", target, "--json", *arguments)
    # An update with a status has no error; the next test has one.
    said = {key: type_ for key, type_ in documented(section).items() if not key.startswith("error.")}
    holds(said, json.loads(done.stdout), complete=known == "everything")


@pytest.mark.parametrize(
    "code",
    [
        grpc.StatusCode.UNAVAILABLE,
        grpc.StatusCode.DEADLINE_EXCEEDED,
        grpc.StatusCode.RESOURCE_EXHAUSTED,
    ],
)
def test_json_of_a_lost_robot_has_exactly_the_documented_keys(
    target: str, double: GatewayDouble, code: grpc.StatusCode
) -> None:
    command = [str(ROBOTCTL), "--target", target, "--json", "watch", "--interval", "0.1"]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True) as watching:
        try:
            assert watching.stdout
            watching.stdout.readline()
            double.failures.extend([(code, "gone")] * 100)
            lost: Any = next(update for update in map(json.loads, watching.stdout) if update["error"])
        finally:
            watching.terminate()
    said = documented("watch --json")
    holds({key: type_ for key, type_ in said.items() if not key.startswith("status.")}, lost, complete=False)
    assert lost["error"].keys() == {key.partition(".")[2] for key in said if key.startswith("error.")}


def test_the_json_of_an_error_has_exactly_the_documented_keys() -> None:
    done = robotctl("--json", "--target", f"127.0.0.1:{free_tcp_port()}", "status")
    holds(documented("An error (on standard error)"), json.loads(only_line(done.stderr)), complete=True)


def test_json_of_the_doctor_has_exactly_the_documented_keys(target: str) -> None:
    done = robotctl("doctor", "--json", "--target", target)
    holds(documented("doctor --json"), json.loads(done.stdout), complete=True)
