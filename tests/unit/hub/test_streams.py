"""Making the hub's streams while its nodes are still joining."""

from typing import Any

import pytest

from fleet.errors import HubError, HubReason
from hub import streams


class _Joining:
    """A hub that answers its first calls with an error.

    Args:
        errors: of the first calls, in their order.
    """

    def __init__(self, errors: list[HubError]) -> None:
        self.errors = errors
        self.calls: list[str] = []

    async def api(self, call: str, _request: Any = None) -> dict[str, Any]:
        self.calls.append(call)
        if self.errors:
            raise self.errors.pop(0)
        if call.startswith("STREAM.INFO."):
            raise HubError(HubReason.MISSING, "the hub refuses: stream not found")
        return {}


def no_quorum() -> HubError:
    return HubError(HubReason.NO_QUORUM, "the hub refuses: no suitable peers for placement, peer offline")


async def made_by(hub: Any) -> list[str]:
    return await streams.set_up(hub, replicas=3)


async def test_nodes_that_are_still_joining_are_waited_for() -> None:
    hub = _Joining([no_quorum(), no_quorum(), no_quorum()])
    assert await made_by(hub) == []
    created = [call.removeprefix("STREAM.CREATE.") for call in hub.calls if "CREATE" in call]
    assert created == list(streams.stream_configs(3))


async def test_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "JOINING_S", 0.5)
    hub = _Joining([no_quorum()] * 1000)
    with pytest.raises(HubError, match="peer offline"):
        await made_by(hub)
    assert 2 <= len(hub.calls) <= 4


async def test_another_refusal_is_not_repeated() -> None:
    full = HubError(HubReason.FULL, "the hub refuses: insufficient resources")
    hub = _Joining([full])
    with pytest.raises(HubError, match="insufficient"):
        await made_by(hub)
    assert len(hub.calls) == 1
