"""How long the monitor waits before it asks again."""

import pytest

from console.client import Backoff, GatewayError, NotAllowed, NotTrusted, Overloaded, Unreachable
from console.monitor.pauses import Pauses

LOST = Backoff(first_s=0.5, factor=2, longest_s=2)
REFUSED = Backoff(first_s=5, factor=2, longest_s=60)


def after(pauses: Pauses, trouble: GatewayError, times: int) -> list[float]:
    return [pauses.after(trouble) for _ in range(times)]


@pytest.mark.parametrize("trouble", [NotAllowed("revoked"), NotTrusted("a stranger")])
def test_who_is_refused_is_more_patient_than_who_hears_nothing(trouble: GatewayError) -> None:
    pauses = Pauses(LOST, REFUSED)
    assert after(pauses, Unreachable("gone"), 4) == [0.5, 1, 2, 2]
    assert after(pauses, trouble, 6) == [5, 10, 20, 40, 60, 60]


def test_an_answer_begins_both_anew() -> None:
    pauses = Pauses(LOST, REFUSED)
    for trouble in (Unreachable("gone"), NotAllowed("revoked")):
        after(pauses, trouble, 3)
    pauses.reset()
    assert (pauses.after(Unreachable("gone")), pauses.after(NotAllowed("revoked"))) == (0.5, 5)


@pytest.mark.parametrize(("wanted_s", "pause_s"), [(None, 0.5), (0.1, 0.5), (7.5, 7.5), (1e9, 60)])
def test_the_robot_may_ask_for_more_patience_within_reason(wanted_s: float | None, pause_s: float) -> None:
    trouble = Overloaded("too many")
    trouble.retry_after_s = wanted_s
    assert Pauses(LOST, REFUSED).after(trouble) == pause_s
