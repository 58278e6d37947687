"""A defect that ends the making of connections ends the program, which is then restarted."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from bridge.app import serve as serve_bridge
from bridge.config import BridgeSettings, GatewaySettings
from console.cli.fleet_watch import _Watch
from fleet.connection import FleetAddress, Hub
from fleet.receipt_keys import as_text, new_seed
from hub.exporter.app import export
from hub.receiver.app import serve as serve_receiver
from hub.receiver.config import HubSettings, ReceiverSettings, StoreSettings
from tests.support.eventually import at_most

NOWHERE = "nats://127.0.0.1:1"


async def bridge(directory: Path) -> None:
    settings = BridgeSettings(
        socket=directory / "bridge.sock",
        root=directory / "outbox",
        gateway=GatewaySettings(target="127.0.0.1:1"),
    )
    await serve_bridge(settings, asyncio.Event())


async def exporter(_directory: Path) -> None:
    await export(FleetAddress((NOWHERE,)), "127.0.0.1", 0, asyncio.Event())


async def receiver(directory: Path) -> None:
    secret, key = directory / "secret", directory / "receipts.key"
    secret.write_text("test")
    key.write_text(as_text([new_seed()]))
    settings = ReceiverSettings(
        fleet="lab",
        hub=HubSettings(servers=(NOWHERE,)),
        store=StoreSettings(
            endpoint="http://127.0.0.1:1", bucket="test", access_key="test", secret_key_file=secret
        ),
        signing_key=key,
        socket=directory / "receiver.sock",
    )
    await serve_receiver(settings, asyncio.Event())


async def breaks(_hub: Hub) -> None:
    raise ZeroDivisionError


async def is_cancelled(_hub: Hub) -> None:
    """A library that is cancelled within, by itself, passes that on."""
    raise asyncio.CancelledError


@pytest.mark.parametrize("program", [bridge, exporter, receiver])
@pytest.mark.parametrize(("defect", "error"), [(breaks, ZeroDivisionError), (is_cancelled, RuntimeError)])
async def test_no_program_goes_on_that_makes_no_connections_any_more(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    program: Callable[[Path], Awaitable[None]],
    defect: Callable[[Hub], Awaitable[None]],
    error: type[Exception],
) -> None:
    """The defect: it stayed without the hub until it was restarted by hand, and said that it was offline."""
    monkeypatch.setattr(Hub, "run", defect)
    async with at_most(30.0, "the program ends"):
        with pytest.raises(error):
            await program(tmp_path)


async def test_nor_does_robotctl_watch_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: it showed the last that it had seen of the fleet, for ever."""

    @asynccontextmanager
    async def connected() -> AsyncIterator[Hub]:
        hub = Hub(FleetAddress((NOWHERE,)))
        hub.supervise()
        yield hub

    async def clock(_hub: Hub) -> Any:
        return SimpleNamespace(unix_ms=lambda: 0)

    async def board(_hub: Hub) -> Any:
        return SimpleNamespace(rows=lambda _now_ms: (), take_robot=None, take_state=None)

    monkeypatch.setattr(Hub, "run", breaks)
    monkeypatch.setattr("fleet.clock.read_clock", clock)
    monkeypatch.setattr("console.fleet.hub.read_board", board)
    session: Any = SimpleNamespace(connect=connected, as_json=True, out=Console(quiet=True))
    async with at_most(30.0, "it ends"):
        with pytest.raises(ExceptionGroup) as raised:
            await _Watch(session, 0.1, None).run()
    assert raised.group_contains(ZeroDivisionError)
