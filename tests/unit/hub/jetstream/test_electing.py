"""What is waited for while the hub elects a leader, and for how long."""

import asyncio

import pytest

from fleet.errors import HubError, HubReason
from hub.jetstream import electing
from tests.support.virtual_time import in_virtual_time


class Work:
    """Something that the hub refuses to do at first.

    Args:
        errors: of the first attempts, in their order.
        takes_s: how long each attempt takes.
    """

    def __init__(self, *errors: HubReason, takes_s: float = 0.0) -> None:
        self._errors = list(errors)
        self._takes_s = takes_s
        self.attempts = 0

    async def __call__(self) -> str:
        self.attempts += 1
        await asyncio.sleep(self._takes_s)
        if self._errors:
            raise HubError(self._errors.pop(0), "the hub does not do it")
        return "done"


@pytest.mark.parametrize(
    "reason", [HubReason.NO_RESPONDERS, HubReason.NO_QUORUM, HubReason.TIMEOUT], ids=lambda each: each.value
)
@in_virtual_time
async def test_a_leader_that_is_being_elected_is_waited_for(reason: HubReason) -> None:
    """Nothing answers while a silent node counts as the leader."""
    work = Work(reason, reason)
    assert await electing.once_elected(work) == "done"
    assert work.attempts == 3


@in_virtual_time
async def test_other_errors_are_final() -> None:
    work = Work(HubReason.FULL)
    with pytest.raises(HubError, match="does not do it"):
        await electing.once_elected(work)
    assert work.attempts == 1


@pytest.mark.parametrize("takes_s", [0.0, 5.0, 60.0])
@in_virtual_time
async def test_without_a_leader_it_ends_in_time(takes_s: float) -> None:
    """The defect: an attempt that began before the end was waited for until its own time-out."""
    with pytest.raises(HubError) as ended:
        await electing.once_elected(Work(*[HubReason.TIMEOUT] * 1000, takes_s=takes_s))
    assert ended.value.reason is HubReason.TIMEOUT
    assert asyncio.get_running_loop().time() == pytest.approx(electing.ELECTED_WITHIN_S)


@in_virtual_time
async def test_the_hubs_own_word_is_what_is_reported() -> None:
    with pytest.raises(HubError, match="does not do it") as ended:
        await electing.once_elected(Work(*[HubReason.NO_QUORUM] * 1000, takes_s=4.0))
    assert ended.value.reason is HubReason.NO_QUORUM


_JOINING = [HubReason.NO_QUORUM, HubReason.TIMEOUT]


@pytest.mark.parametrize("reason", _JOINING, ids=lambda each: each.value)
@in_virtual_time
async def test_nodes_that_still_join_are_waited_for_until_the_end(reason: HubReason) -> None:
    """And then tried once more: they may have joined during the last pause."""
    work = Work(*[reason] * 1000)
    with pytest.raises(HubError, match="does not do it") as ended:
        await electing.once_joined(work, 10.0)
    assert ended.value.reason is reason
    assert asyncio.get_running_loop().time() == pytest.approx(10.0)
    assert 10 < work.attempts < 20


@pytest.mark.parametrize("before", [[], [HubReason.NO_QUORUM]], ids=["first", "second"])
@in_virtual_time
async def test_an_attempt_that_is_begun_in_time_is_not_ended(before: list[HubReason]) -> None:
    assert await electing.once_joined(Work(*before, takes_s=4.0), 4.2) == "done"


@in_virtual_time
async def test_one_attempt_is_made_where_no_time_is_left() -> None:
    """The defect: it was refused without one, in words that gave no reason."""
    assert await electing.once_joined(Work(takes_s=1.5), 0.0) == "done"
    work = Work(*_JOINING, takes_s=1.5)
    with pytest.raises(HubError, match="does not do it") as ended:
        await electing.once_joined(work, 0.0)
    assert (ended.value.reason, work.attempts) == (HubReason.NO_QUORUM, 1)


@in_virtual_time
async def test_servers_without_jetstream_are_not_waited_for() -> None:
    work = Work(HubReason.NO_RESPONDERS)
    with pytest.raises(HubError, match="does not do it"):
        await electing.once_joined(work, 10.0)
    assert work.attempts == 1
