"""Commands that people type on a deployment, and the credentials that they make."""

import shlex
import subprocess

from console.client.blocking import GatewayClient
from console.client.errors import GatewayError
from console.credentials import Credentials
from console.robots.login import parse_login
from tests.e2e.containers.deployment import Deployment

ADD = "docker compose run --rm -T credentials add anna --role operator"


def typed(deployment: Deployment, command: str) -> subprocess.CompletedProcess[str]:
    """What a command does that people type, on this project; whether it works is for the caller to see."""
    words = shlex.split(command)
    assert words[:2] == ["docker", "compose"], command
    return deployment.run(*words[2:], check=False)


def added(deployment: Deployment, name: str, role: str) -> Credentials:
    """A new credential, as its owner's laptop has it."""
    done = typed(deployment, ADD.replace("anna", name).replace("operator", role))
    assert done.returncode == 0, done.stderr
    return parse_login(done.stdout).credentials


def knows(robot: GatewayClient) -> bool:
    """Whether the gateway has taken over the client's credential."""
    try:
        robot.status()
    except GatewayError:
        return False
    return True
