"""The pauses between the monitor's attempts."""

import pytest

from common.backoff import Backoff
from console.client import GatewayError, NotAllowed, NotTrusted, Overloaded, Unreachable
from console.monitor.conversation import RetryBackoff


def retry_backoff() -> RetryBackoff:
    return RetryBackoff(Backoff(first_s=0.5, longest_s=2), Backoff(first_s=5, longest_s=60))


def pauses_s(retry: RetryBackoff, error: GatewayError, times: int) -> list[float]:
    return [retry.next_s(error) for _ in range(times)]


@pytest.mark.parametrize("error", [NotAllowed("revoked"), NotTrusted("a stranger")])
@pytest.mark.parametrize("make", [retry_backoff, RetryBackoff], ids=["given", "default"])
def test_rejected_credentials_are_presented_less_often_than_a_silent_robot_is_asked(
    make: type[RetryBackoff], error: GatewayError
) -> None:
    retry = make()
    assert pauses_s(retry, Unreachable("gone"), 4) == [0.5, 1, 2, 2]
    assert pauses_s(retry, error, 6) == [5, 10, 20, 40, 60, 60]


def test_an_answer_resets_both() -> None:
    retry = retry_backoff()
    for error in (Unreachable("gone"), NotAllowed("revoked")):
        pauses_s(retry, error, 3)
    retry.reset()
    assert (retry.next_s(Unreachable("gone")), retry.next_s(NotAllowed("revoked"))) == (0.5, 5)


@pytest.mark.parametrize(("retry_after_s", "pause_s"), [(None, 0.5), (0.1, 0.5), (7.5, 7.5), (1e9, 60)])
def test_the_robot_may_ask_for_a_longer_pause_within_reason(
    retry_after_s: float | None, pause_s: float
) -> None:
    error = Overloaded("too many")
    error.retry_after_s = retry_after_s
    assert retry_backoff().next_s(error) == pause_s
