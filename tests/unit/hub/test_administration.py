"""What the administration waits for while a node of the hub is lost."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest

from fleet import names
from fleet.errors import HubError, HubReason
from fleet.opening import NEXT_AFTER_S, REFUSED_AFTER_S
from hub import administration
from hub.directory import HubDirectory, HubRecord, User
from hub.receiver import relisting
from tests.support.virtual_time import in_virtual_time


class Electing:
    """A hub whose streams have no leader yet: of each, nothing answers the first request."""

    def __init__(self) -> None:
        self._led: set[str] = set()
        self.purged: list[str] = []

    async def stream_info(self, stream: str) -> dict[str, Any]:
        self._need_leader(stream)
        return {"state": {"bytes": 1}, "config": {"max_bytes": 2}}

    async def count(self, stream: str, subjects: str) -> int:
        self._need_leader(f"{stream} {subjects}")
        return 7

    async def api(self, call: str, _request: Any, _timeout_s: float) -> dict[str, Any]:
        stream = call.removeprefix("STREAM.PURGE.")
        self._need_leader(stream)
        self.purged.append(stream)
        return {"purged": 3}

    def _need_leader(self, what: str) -> None:
        if what not in self._led:
            self._led.add(what)
            raise HubError(HubReason.TIMEOUT, "no answer from the hub within 5 s")


class Directory:
    """One of a hub with one robot."""

    def read(self) -> HubRecord:
        return HubRecord("lab", ("tls://hub:4222",), 3, users=(User("r1", "robot", ("key",)),))


@pytest.fixture
def electing(monkeypatch: pytest.MonkeyPatch) -> Electing:
    hub = Electing()

    @asynccontextmanager
    async def connected(_directory: HubDirectory) -> AsyncIterator[Electing]:
        yield hub

    monkeypatch.setattr(administration, "_connected", connected)
    return hub


_DIRECTORY = cast("HubDirectory", Directory())


@pytest.mark.usefixtures("electing")
@in_virtual_time
async def test_how_full_the_streams_are_is_read_when_there_is_a_leader() -> None:
    """The defect: it failed, as `purge` did, although the other commands of the administration wait."""
    use = await administration.usage(_DIRECTORY)
    assert [each.ratio for each in use.streams] == [0.5] * 3
    assert use.events == (("r1", 7),)


@in_virtual_time
async def test_a_purge_waits_for_a_leader_and_is_made_once(electing: Electing) -> None:
    """Made again after a time-out, it would say of what the first one deleted that there was nothing."""
    purged = await administration.purge(_DIRECTORY, "r1", recordings=True)
    streams = [names.EVENTS, names.RESULTS, f"KV_{names.RECORDINGS}"]
    assert purged == dict.fromkeys(streams, 3)
    assert electing.purged == streams


@pytest.mark.parametrize("patience_s", [administration._CONNECT_S, relisting._CONNECT_S])
def test_two_silent_servers_of_three_leave_time_for_the_third(patience_s: float) -> None:
    assert patience_s / 2 > 2 * NEXT_AFTER_S


@pytest.mark.parametrize("patience_s", [administration._CONNECT_S, relisting._CONNECT_S])
def test_and_a_refusal_is_known_before_it_ends(patience_s: float) -> None:
    assert patience_s > 2 * NEXT_AFTER_S + REFUSED_AFTER_S
