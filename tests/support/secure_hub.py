"""A hub as its administrator makes it: TLS, identities and permissions, with real servers on this machine."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from fleet import names
from fleet.connection import FleetAddress, Hub, connect
from fleet.errors import HubError, HubReason
from fleet.identity import Permissions, new_user
from fleet.names import inbox_prefix
from hub import administration, permissions
from hub.creation import HubPlan, create
from hub.directory import HubDirectory
from hub.server_config import Node, Places
from tests.support.hub_patience import in_the_end
from tests.support.nats_servers import DEBIAN_SERVER, SERVER, NatsServers

BOTH_SERVERS: Final = [
    pytest.param(SERVER, id="newest"),
    pytest.param(
        DEBIAN_SERVER,
        id="debian",
        marks=pytest.mark.skipif(not DEBIAN_SERVER, reason="nats-server of Debian"),
    ),
]
"""For a fixture: the server that this project brings, and the oldest that is supported."""
_LOOPBACK = "127.0.0.1"
_ANSWERS_WITHIN_S = 20.0
"""A handshake over TLS takes seconds on a busy machine."""


class SecureHub:
    """The hub, and who is enrolled.

    Args:
        directory: for everything.
        nodes: 1 or 3.
        binary: which server.
    """

    def __init__(self, directory: Path, nodes: int = 1, binary: Path | str = SERVER) -> None:
        self.path = directory
        self.directory = HubDirectory(directory / "hub")
        self.servers = NatsServers(directory, nodes, binary=binary, whole=self._text, scheme="tls")
        places = Places(listen=_LOOPBACK)
        self.plan = HubPlan("lab", self._nodes(), places, "64GB", sync_always=binary == SERVER)
        create(self.directory, self.plan)

    def start(self) -> None:
        """Starts the servers, and makes the streams."""
        self.servers.start_all()
        assert asyncio.run(in_the_end(partial(administration.apply, self.directory))) == []

    def enroll(self, robot: str) -> FleetAddress:
        """Enrolls a robot; returns how it connects."""
        enroll = partial(administration.enroll, self.directory, robot, self.path / robot)
        asyncio.run(in_the_end(enroll))
        return self.address(self.path / robot / "bridge.creds", inbox_prefix(robot))

    def unlisted_robot(self, robot: str) -> FleetAddress:
        """Issues a robot's credentials without enrolling it, which takes a while; returns how it connects."""
        return self._of_robots(robot, permissions.robot(robot), inbox_prefix(robot))

    def all_robots(self) -> FleetAddress:
        """Returns how simulated robots connect that share a connection: it speaks for every robot."""
        subjects = (names.EVENT_SUBJECTS, f"$KV.{names.STATES}.*")
        return self._of_robots("all-robots", Permissions(subjects, (f"{names.INBOXES}.>",)), names.INBOXES)

    def operator(self, name: str, *, commands: bool = False) -> FleetAddress:
        """Issues credentials for a person; returns how they connect."""
        login = administration.operator_login(self.directory, name, commands=commands, days=None, again=False)
        creds = self.path / f"{name}.creds"
        creds.write_text(login.partition("credentials:\n")[2].partition("authority:")[0], encoding="ascii")
        return self.address(creds)

    def program(self, name: str) -> FleetAddress:
        """Issues credentials for a program that reads, the exporter; returns how it connects."""
        out = self.path / name
        administration.operator_files(self.directory, name, out, days=None, again=False)
        return self.address(out / "operator.creds")

    def receiver(self, name: str = "receiver") -> FleetAddress:
        """Issues credentials for a receiver; returns how it connects."""
        out = self.path / name
        administration.receiver_files(self.directory, name, out, days=None, again=False)
        return self.address(out / "receiver.creds")

    def administrator(self) -> FleetAddress:
        """How the administration connects."""
        return self.directory.address("admin")

    def address(self, credentials: Path, inbox: str = "_INBOX") -> FleetAddress:
        """How to connect with these credentials."""
        return FleetAddress(self.servers.urls, credentials, self.directory.ca_file, inbox)

    def _of_robots(self, name: str, allowed: Permissions, inbox: str) -> FleetAddress:
        creds, _ = new_user(self.directory.key("robots"), name, allowed)
        file = self.path / f"{name}.creds"
        file.write_text(creds.text(), encoding="ascii")
        return self.address(file, inbox)

    def _nodes(self) -> tuple[Node, ...]:
        ports = zip(self.servers.ports, self.servers.routes, self.servers.monitors, strict=True)
        return tuple(
            Node(f"n{number}", _LOOPBACK, port, route, f"{_LOOPBACK}:{monitor}")
            for number, (port, route, monitor) in enumerate(ports)
        )

    def _text(self, servers: NatsServers, node: int) -> str:
        """The configuration that was made, with this machine's directories."""
        made = self.directory.path / "nodes" / f"n{node}"
        places = Places(str(made), str(servers.directory / f"n{node}"), _LOOPBACK)
        text = (made / "nats.conf").read_text(encoding="utf-8")
        default = replace(places, config=self.plan.places.config, data=self.plan.places.data)
        return text.replace(default.config, places.config).replace(default.data, places.data)


@contextmanager
def secure_hub(directory: Path, nodes: int = 1, binary: Path | str = SERVER) -> Iterator[SecureHub]:
    """Up and set up when the block begins, gone when it ends."""
    hub = SecureHub(directory, nodes, binary)
    try:
        hub.start()
        yield hub
    finally:
        hub.servers.close()


async def until_accepted(hub: Hub) -> None:
    """Returns when there is a connection. A server that gives up a client which stood still is tried again.

    Raises:
        HubError: the hub refuses, or nothing answers in time.
    """

    def answered() -> bool:
        return hub.link.connected or hub.link.reason is HubReason.REFUSED

    await hub.changed.wait_until(answered, _ANSWERS_WITHIN_S)
    await hub.connected(0.0)


def answer_to(address: FleetAddress, *, once: bool = False) -> HubReason | None:
    """Returns why there is no connection, UNREACHABLE also where nothing answers; None: there is one.

    Args:
        address: of the hub.
        once: whether to try once, for a caller that measures: the pauses between attempts take seconds.
    """

    async def answer() -> HubReason | None:
        async with connect(address) as hub:
            try:
                if once:
                    await hub.connected(_ANSWERS_WITHIN_S, once=True)
                else:
                    await until_accepted(hub)
            except HubError as error:
                return error.reason
            return None

    return asyncio.run(answer())
