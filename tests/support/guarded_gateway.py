"""A gateway that asks who calls: with credentials of its own, over real TLS, in the test's own loop."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.ca import KeyPair
from gateway.access.credential import Credential, Kind
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.login_bundle import LoginBundle
from gateway.access.role import Role
from gateway.app import serve
from gateway.config import GatewaySettings
from tests.support.free import free_tcp_port

HOSTS = ("localhost", "127.0.0.1")
UP_WITHIN_S = 10.0


@dataclass(frozen=True)
class Login:
    """What one caller shows."""

    token: str | None = None
    client: KeyPair | None = None

    def metadata(self) -> tuple[tuple[str, str], ...]:
        return () if self.token is None else (("authorization", f"Bearer {self.token}"),)


NOTHING = Login()


@dataclass
class Robot:
    """One robot's credentials, and how it is reached."""

    directory: CredentialDirectory
    port: int = 0
    host: str = "127.0.0.1"
    """By which its callers call."""
    channels: list[grpc.aio.Channel] = field(default_factory=list)

    @property
    def admin(self) -> CredentialAdmin:
        return CredentialAdmin(self.directory, "lab")

    @property
    def ca(self) -> bytes:
        return self.directory.ca.read().certificate

    @property
    def audit_file(self) -> Path:
        return self.directory.path / "audit.jsonl"

    @property
    def refused_file(self) -> Path:
        return self.directory.path / "audit-refused.jsonl"

    def add(
        self, role: Role, kind: Kind = Kind.TOKEN, name: str = "anna", **wanted: Any
    ) -> "tuple[Credential, Login]":
        credential, bundle = self.admin.add(CredentialRequest(name, role, kind, **wanted))
        return credential, login_of(bundle)

    def channel(self, login: Login = NOTHING, ca: bytes | None = None) -> grpc.aio.Channel:
        """A connection of its own; closed with the gateway."""
        client = login.client
        credentials = grpc.ssl_channel_credentials(
            ca or self.ca,
            private_key=client.key if client else None,
            certificate_chain=client.certificate if client else None,
        )
        channel = grpc.aio.secure_channel(
            f"{self.host}:{self.port}", credentials, options=(("grpc.use_local_subchannel_pool", 1),)
        )
        self.channels.append(channel)
        return channel


def login_of(bundle: LoginBundle) -> Login:
    return Login(bundle.token or None, bundle.client)


def refuse_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Takes the delay of refusals away, for tests with hundreds of them that do not measure it.

    Its numbers are those of tests/unit/gateway/rpc/interceptors and of the siege (bench/siege).
    """
    for name in ("REFUSAL_DELAY_S", "REFUSAL_SPACING_S"):
        monkeypatch.setattr(f"gateway.rpc.connections.refusal_delay.{name}", 0.0)


def new_robot(path: Path) -> Robot:
    """Credentials alone; nothing runs yet."""
    robot = Robot(CredentialDirectory(path))
    robot.admin.initialize(HOSTS)
    return robot


@asynccontextmanager
async def guarded_gateway(robot: Robot, **settings: Any) -> AsyncIterator[Robot]:
    """Up when the block begins, gone when it ends."""
    robot.port, stop = free_tcp_port(), asyncio.Event()
    security = {"credentials": robot.directory.path, **settings.pop("security", {})}
    values = {
        "grpc": {"port": robot.port, **settings.pop("grpc", {})},
        "sources": (),
        "preview": {"socket": robot.directory.path / "preview.sock", "settle_ms": 0},
        **settings,
        "security": security,
    }
    gateway = asyncio.create_task(serve(GatewaySettings(**values), stop))
    try:
        await _until_it_listens(gateway, robot.port)
        yield robot
    finally:
        for channel in robot.channels:
            await channel.close()
        robot.channels.clear()
        stop.set()
        await asyncio.wait_for(gateway, 10)


async def _until_it_listens(gateway: "asyncio.Task[None]", port: int) -> None:
    deadline_s = asyncio.get_running_loop().time() + UP_WITHIN_S
    while True:
        if gateway.done():
            gateway.result()
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
        except ConnectionRefusedError:
            assert asyncio.get_running_loop().time() < deadline_s, "the gateway did not come up"
            await asyncio.sleep(0.02)
        else:
            writer.close()
            return
