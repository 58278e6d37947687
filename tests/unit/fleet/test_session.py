"""A session that is being opened ends when it is cancelled, whatever the NATS library makes of it."""

import asyncio
import traceback
from functools import partial
from typing import Any

import pytest

from fleet import nats_client
from fleet.errors import UnreachableError
from fleet.replies import NotTaken
from fleet.session import Session


class _Connecting(nats_client._BoundedClient):
    """Connects when a test says so, and waits as the library does."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.connected = asyncio.get_running_loop().create_future()

    async def connect(self, *_: Any, **__: Any) -> None:
        await asyncio.wait_for(self.connected, 5)

    async def close(self) -> None:
        """There is nothing to close."""

    @property
    def is_connected(self) -> bool:
        pytest.fail("it went on although it was cancelled")


async def test_a_cancellation_that_comes_with_the_connection_is_not_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clients: list[_Connecting] = []

    def client(*args: Any) -> _Connecting:
        clients.append(_Connecting(*args))
        return clients[-1]

    monkeypatch.setattr(nats_client, "_BoundedClient", client)
    opening = asyncio.create_task(
        Session.open("nats://127.0.0.1:1", credentials=None, ca=None, inbox="_INBOX", name="")
    )
    await asyncio.sleep(0)
    clients[0].connected.set_result(None)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening


async def test_an_error_that_many_calls_raise_does_not_grow_with_them() -> None:
    """The defect: it kept the place of each, and to print it took minutes."""
    lost = Session("nats://127.0.0.1:1", "_INBOX", NotTaken())
    lost.on_lost(UnreachableError("it can't be reached"))
    places = []
    for _ in range(3):
        for call in (partial(lost.publish, "a", b""), partial(lost.request, "a", b"", 1.0)):
            with pytest.raises(UnreachableError, match="can't be reached") as raised:
                await call()
            places.append(len(list(traceback.walk_tb(raised.value.__traceback__))))
    assert places[2:] == [*places[:2], *places[:2]]
