"""Several hosts of the store, each by its own interface."""

from collections.abc import AsyncIterator
from typing import Any

import pytest

from bridge.uploads import uploads
from bridge.uploads.queue import State
from fleet.errors import UnreachableError
from tests.support.uploading import Robot, running_uploads


class NoHub:
    """A hub that is not there."""

    async def request(self, *_: Any) -> bytes:
        raise UnreachableError("no connection")

    def request_many(self, *_: Any) -> AsyncIterator[bytes]:
        raise UnreachableError("no connection")


@pytest.mark.parametrize(
    ("reached", "paused"),
    [
        ({"one": "wwan0", "two": "wlan0"}, ""),
        ({"one": "", "two": "wlan0"}, ""),
        (
            {"one": "wwan0", "two": "eth0"},
            "the store is reached through wwan0; uploads are allowed through wlan*",
        ),
    ],
)
async def test_one_host_that_may_be_reached_opens_the_gate(
    monkeypatch: pytest.MonkeyPatch, reached: dict[str, str], paused: str
) -> None:
    async def interface_to(host: str) -> str:
        return reached[host]

    monkeypatch.setattr(uploads, "interface_to", interface_to)
    robot = Robot()
    robot.add("rec", {"data.bin": b"x"})
    settings: dict[str, Any] = {"store_hosts": tuple(reached), "insecure_store": False}
    async with running_uploads(robot, NoHub(), "", (), interfaces=("wlan*",), **settings) as running:
        await running.uploads.enqueue("rec")
        # With the gate open an attempt is made, and there is no hub.
        await running.until("rec", lambda found: found and found.state in (State.PAUSED, State.FAILED), 10)
        assert running.uploads.paused == paused
