"""Gateways that can be besieged: one that is started for it, and one that runs."""

import shlex
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.role import Role
from tests.support.free import free_tcp_port
from tests.support.guarded_program import guarded_program

_CLOSED: Final = "robot_gateway_connections_closed_total "


class Keeper(Protocol):
    """Who may change the gateway's credentials."""

    def add(self, name: str, role: Role) -> str:
        """Returns a new login."""

    def revoke(self, name: str) -> None:
        """Returns when the credential is revoked on the disk."""


@dataclass(frozen=True, slots=True)
class OwnKeeper:
    """Keeps the files of a gateway of this machine."""

    admin: CredentialAdmin

    def add(self, name: str, role: Role) -> str:
        """Returns a new login."""
        return self.admin.add(CredentialRequest(name, role))[1].text()

    def revoke(self, name: str) -> None:
        """Returns when the credential is revoked on the disk."""
        self.admin.revoke(name)


@dataclass(frozen=True, slots=True)
class CommandKeeper:
    """Types commands, as the keeper of a deployment does.

    Args:
        command: what `add` and `revoke` are words of: "docker compose run --rm -T credentials".
    """

    command: str

    def add(self, name: str, role: Role) -> str:
        """Returns a new login."""
        return self._type("add", name, "--role", role.value)

    def revoke(self, name: str) -> None:
        """Returns when the command has ended."""
        self._type("revoke", name)

    def _type(self, *words: str) -> str:
        command = [*shlex.split(self.command), *words]
        return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


@dataclass(frozen=True, slots=True)
class Ground:
    """A guarded gateway that runs.

    Args:
        host: by which everyone calls.
        port: of operators.
        keeper: changes its credentials.
        pid: of the program.
        metrics_port: on this machine; None where it has none.
    """

    host: str
    port: int
    keeper: Keeper
    pid: int
    metrics_port: int | None = None

    @property
    def target(self) -> str:
        """Host and port."""
        return f"{self.host}:{self.port}"

    def closed_connections(self) -> float | None:
        """Returns how many connections the gateway's guard has closed; None where that is not known."""
        if self.metrics_port is None:
            return None
        with urllib.request.urlopen(f"http://127.0.0.1:{self.metrics_port}/metrics", timeout=10) as answer:
            lines = answer.read().decode().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith(_CLOSED))


@contextmanager
def own_ground(directory: Path) -> Iterator[Ground]:
    """Runs a gateway with credentials, TLS and the limits that it has by default; without sources.

    Args:
        directory: for its files.
    """
    metrics_port = free_tcp_port()
    with guarded_program(directory, directory, metrics={"port": metrics_port}) as robot:
        host, _, port = robot.target.rpartition(":")
        yield Ground(host, int(port), OwnKeeper(robot.admin), robot.pid, metrics_port)
