"""Making the hub's streams while its nodes are still joining, or elect a leader."""

import asyncio
from typing import Any

import pytest

from fleet import names
from fleet.errors import HubError, HubReason
from hub.jetstream import streams
from tests.support.virtual_time import in_virtual_time


class _Joining:
    """A hub that answers its first calls with an error.

    Args:
        errors: of the first calls, in their order.
        joined_s: until when, of the event loop's clock, too few nodes have joined to make a stream.
        takes_s: how long it takes to make one then.
    """

    def __init__(self, errors: list[HubError], joined_s: float = 0.0, takes_s: float = 0.0) -> None:
        self.errors = errors
        self.calls: list[str] = []
        self._joined_s = joined_s
        self._takes_s = takes_s

    async def api(self, call: str, _request: Any = None) -> dict[str, Any]:
        self.calls.append(call)
        if "CREATE" in call:
            if asyncio.get_running_loop().time() < self._joined_s:
                raise no_quorum()
            await asyncio.sleep(self._takes_s)
        if self.errors:
            raise self.errors.pop(0)
        if call.startswith("STREAM.INFO."):
            raise HubError(HubReason.MISSING, "the hub refuses: stream not found")
        return {}


def no_quorum() -> HubError:
    return HubError(HubReason.NO_QUORUM, "the hub refuses: no suitable peers for placement, peer offline")


async def made_by(hub: Any, *limits: streams.StreamLimits) -> list[str]:
    return await streams.set_up(hub, 3, *limits)


@in_virtual_time
async def test_nodes_that_are_still_joining_are_waited_for() -> None:
    hub = _Joining([no_quorum(), no_quorum(), no_quorum()])
    assert await made_by(hub) == []
    created = [call.removeprefix("STREAM.CREATE.") for call in hub.calls if "CREATE" in call]
    assert created == list(streams.stream_configs(3))


@in_virtual_time
async def test_a_leader_that_answers_nothing_is_waited_for() -> None:
    """A node that stands still counts as the leader until the others have elected another one."""
    hub = _Joining([HubError(HubReason.TIMEOUT, "no answer from the hub within 5 s")])
    assert await made_by(hub) == []


@in_virtual_time
async def test_but_not_for_ever() -> None:
    hub = _Joining([no_quorum()] * 1000)
    with pytest.raises(HubError, match=r"^fleet_events can't be set up: .*peer offline"):
        await made_by(hub)
    assert asyncio.get_running_loop().time() == pytest.approx(streams.JOINING_S)
    assert streams.JOINING_S / 2 < len(hub.calls) < 2 * streams.JOINING_S, "about once a second"


@pytest.mark.parametrize("takes_s", [0.25, 4.0])
@in_virtual_time
async def test_nodes_that_have_joined_at_the_last_moment_make_all_streams(takes_s: float) -> None:
    """The defect: when the time to join had passed, a stream in the making was given up, others not made."""
    hub = _Joining([], streams.JOINING_S - 0.5, takes_s)
    assert await made_by(hub) == []
    assert len([call for call in hub.calls if "CREATE" in call]) > len(streams.stream_configs(3))


@in_virtual_time
async def test_servers_without_jetstream_are_reported_at_once() -> None:
    """The defect: after 30 s. Nodes that still join never answer so."""
    nothing = HubError(HubReason.NO_RESPONDERS, "nothing at the hub takes $JS.API.STREAM.INFO.fleet_events")
    with pytest.raises(HubError, match="run without JetStream") as refused:
        await made_by(_Joining([nothing] * 1000))
    assert refused.value.reason is HubReason.NO_RESPONDERS
    assert asyncio.get_running_loop().time() == 0


class _Made:
    """A hub whose streams exist, with other limits than the usual ones."""

    def __init__(self, **limits: int) -> None:
        self.limits = limits
        self.updates: dict[str, dict[str, Any]] = {}

    async def api(self, call: str, request: Any = None) -> dict[str, Any]:
        kind, name = call.split(".")[1:]
        if kind == "UPDATE":
            self.updates[name] = request
        return {"config": {**streams.stream_configs(3)[name], **self.limits}}


async def test_streams_without_a_limit_get_none() -> None:
    hub = _Made(max_bytes=-1, max_age=0)
    limits = streams.StreamLimits(events_bytes=1, events_days=1, recordings_bytes=1)
    differences = await made_by(hub, limits)
    assert hub.updates == {}
    assert "fleet_events: max_bytes is -1, expected 1" in differences
    assert f"fleet_results: max_age is 0, expected {86_400 * 10**9}" in differences


async def test_limits_that_are_no_choice_are_differences() -> None:
    chosen = {names.EVENTS, f"KV_{names.RECORDINGS}"}
    differing = {each.partition(":")[0] for each in await made_by(_Made(max_bytes=1))}
    assert differing == streams.stream_configs(3).keys() - chosen


async def test_another_refusal_is_not_repeated() -> None:
    full = HubError(HubReason.FULL, "the hub refuses: insufficient resources")
    hub = _Joining([full])
    with pytest.raises(HubError, match="insufficient"):
        await made_by(hub)
    assert len(hub.calls) == 1
