"""What the administration waits for while a node of the hub is lost, and for how long."""

import time

import pytest

from fleet.errors import HubError, HubReason
from fleet.opening import NEXT_AFTER_S
from hub import administration
from hub.receiver import relisting


class Work:
    """Something that the hub refuses to do at first.

    Args:
        errors: of the first attempts, in their order.
    """

    def __init__(self, *errors: HubReason) -> None:
        self._errors = list(errors)
        self.attempts = 0

    async def __call__(self) -> None:
        self.attempts += 1
        if self._errors:
            raise HubError(self._errors.pop(0), "the hub does not do it")


@pytest.mark.parametrize(
    "reason", [HubReason.NO_RESPONDERS, HubReason.NO_QUORUM, HubReason.TIMEOUT], ids=lambda each: each.value
)
async def test_a_leader_that_is_being_elected_is_waited_for(reason: HubReason) -> None:
    """Nothing answers while a silent node counts as the leader."""
    work = Work(reason, reason)
    await administration._once_elected(work)
    assert work.attempts == 3


async def test_other_errors_are_final() -> None:
    work = Work(HubReason.FULL)
    with pytest.raises(HubError, match="does not do it"):
        await administration._once_elected(work)
    assert work.attempts == 1


async def test_without_a_leader_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(administration, "_ELECTED_WITHIN_S", 0.2)
    begun_s = time.monotonic()
    with pytest.raises(HubError, match="does not do it") as ended:
        await administration._once_elected(Work(*[HubReason.TIMEOUT] * 1000))
    assert ended.value.reason is HubReason.TIMEOUT
    assert time.monotonic() - begun_s >= 0.2


@pytest.mark.parametrize("patience_s", [administration._CONNECT_S, relisting._CONNECT_S])
def test_two_silent_servers_of_three_leave_time_for_the_third(patience_s: float) -> None:
    assert patience_s / 2 > 2 * NEXT_AFTER_S
