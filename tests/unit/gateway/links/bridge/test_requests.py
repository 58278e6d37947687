"""What becomes of each request of the hub: the failure table, row by row."""

from dataclasses import replace
from typing import Any

import pytest

from gateway.links.bridge.requests import (
    BURST,
    MOST_DONE,
    MOST_REFUSED,
    RATE_PER_MINUTE,
    Answer,
    HubRequestRules,
    Outcome,
)
from gateway.status.cloud import HubAction, HubRequest

NOW_S = 1000.0
UPLOAD = HubRequest("u", "anna", NOW_S + 60, HubAction.UPLOAD, recording_id="a")
SNAPSHOT = HubRequest("s", "anna", NOW_S + 60, HubAction.SNAPSHOT)
BOTH = tuple(HubAction)
DONE = Answer(Outcome.DONE, "done")


def refusal(request: HubRequest, allowed: Any = BOTH, now_s: float = NOW_S) -> str:
    answer = HubRequestRules(allowed, NOW_S).refusal(request, now_s)
    assert answer is None or answer.outcome is Outcome.REFUSED
    return answer.message if answer else ""


@pytest.mark.parametrize(
    ("request_", "allowed", "now_s", "why"),
    [
        pytest.param(UPLOAD, BOTH, NOW_S, "", id="allowed"),
        pytest.param(SNAPSHOT, (HubAction.SNAPSHOT,), NOW_S, "", id="allowed alone"),
        pytest.param(UPLOAD, BOTH, NOW_S + 59.9, "", id="in time"),
        pytest.param(UPLOAD, (), NOW_S, "lacks 'upload'", id="nothing is allowed"),
        pytest.param(SNAPSHOT, (), NOW_S, "lacks 'snapshot'", id="no snapshot is allowed"),
        pytest.param(UPLOAD, (HubAction.SNAPSHOT,), NOW_S, "lacks 'upload'", id="another is allowed"),
        pytest.param(replace(UPLOAD, action=None), BOTH, NOW_S, "does not know", id="unknown"),
        pytest.param(UPLOAD, BOTH, NOW_S + 60, "expired", id="expired"),
        pytest.param(replace(UPLOAD, expires_s=NOW_S), BOTH, NOW_S, "expired", id="expired at once"),
    ],
)
def test_what_becomes_of_a_request(request_: HubRequest, allowed: Any, now_s: float, why: str) -> None:
    found = refusal(request_, allowed, now_s)
    assert why in found
    assert bool(found) == bool(why)


def test_more_than_the_rate_is_refused_and_refusals_take_no_token() -> None:
    rules = HubRequestRules((HubAction.UPLOAD,), NOW_S)

    def passes(number: int, now_s: float, action: HubAction = HubAction.UPLOAD) -> bool:
        return rules.refusal(replace(UPLOAD, request_id=str(number), action=action), now_s) is None

    assert not any(passes(number, NOW_S, HubAction.SNAPSHOT) for number in range(50))
    assert [passes(number, NOW_S) for number in range(100, 110)] == [True] * BURST + [False] * 7
    later = [passes(200 + second, NOW_S + second) for second in range(1, 58)]
    assert sum(later) == RATE_PER_MINUTE - 1, "one every ten seconds"


def test_what_was_answered_is_answered_alike_and_not_carried_out_again() -> None:
    rules = HubRequestRules(BOTH, NOW_S)
    assert rules.known("u") is None
    assert rules.refusal(UPLOAD, NOW_S) is None
    rules.carried_out("u", DONE)
    assert rules.known("u") == DONE
    late = rules.refusal(replace(SNAPSHOT, expires_s=0.0), NOW_S)
    assert rules.known("s") == late


def test_ten_thousand_refused_requests_make_it_forget_none_that_was_carried_out() -> None:
    rules = HubRequestRules((), NOW_S)
    rules.carried_out("u", DONE)
    for number in range(10_000):
        assert rules.refusal(replace(SNAPSHOT, request_id=str(number)), NOW_S)
    assert rules.known("u") == DONE
    remembered = [number for number in range(10_000) if rules.known(str(number))]
    assert len(remembered) == MOST_REFUSED
    assert remembered[-1] == 9_999
    for number in range(2 * MOST_DONE):
        rules.carried_out(f"done {number}", DONE)
    assert sum(rules.known(f"done {number}") is not None for number in range(2 * MOST_DONE)) == MOST_DONE
