"""A defect that ends the making of connections ends the program, which is then restarted."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from bridge.app import serve as serve_bridge
from bridge.config import BridgeSettings, GatewaySettings
from fleet.connection import FleetAddress, Hub
from hub.exporter.app import export
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


async def breaks(_hub: Hub) -> None:
    raise ZeroDivisionError


async def is_cancelled(_hub: Hub) -> None:
    """A library that is cancelled within, by itself, passes that on."""
    raise asyncio.CancelledError


@pytest.mark.parametrize("program", [bridge, exporter])
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
