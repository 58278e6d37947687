"""A stream over any number of connections, without a network: what is done in which order."""

from typing import Any

import pytest

from console.client.errors import (
    DeadlineExceeded,
    GatewayError,
    InvalidRequest,
    Overloaded,
    Unreachable,
    Unsupported,
)
from console.client.exchange import Pause, Send
from console.client.feed import EventFeed
from console.client.following import Following, Followings, Open, Outage, Read, Tell, go_on
from console.client.mapping.methods import GET_SYSTEM_STATUS, SUBSCRIBE_EVENTS, WATCH_SYSTEM_STATUS
from console.client.options import Backoff, ClientOptions
from console.client.results import CaughtUp, EventPosition, WatchedStatus

OPTIONS = ClientOptions(
    backoff=Backoff(first_s=0.1, longest_s=0.4, give_up_after_s=1.0),
    stream_backoff=Backoff(first_s=0.1, longest_s=0.4),
)
STATUS: Any = WatchedStatus(status=None, monotonic_ns=1)  # type: ignore[arg-type]  # never looked into
GONE = Unreachable("gone")


class Driver:
    """Carries out steps as a test says, and keeps them."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.followings = Followings(OPTIONS, lambda: self.now_s)

    def run(self, following: Following, *outcomes: Any) -> list[Any]:
        """The steps, until a Read or Send finds no outcome left; pauses let time pass."""
        left, steps = list(outcomes), []
        step = go_on(following, None)
        while True:
            steps.append(step)
            outcome = None
            if isinstance(step, Pause):
                self.now_s += step.seconds
            elif isinstance(step, Read | Send):
                if not left:
                    return steps
                outcome = left.pop(0)
            step = go_on(following, outcome)


@pytest.fixture
def driver() -> Driver:
    return Driver()


def kinds(steps: list[Any]) -> list[str]:
    return [type(step).__name__ for step in steps]


def test_what_is_read_is_told(driver: Driver) -> None:
    steps = driver.run(driver.followings.status(0.5), STATUS, STATUS)
    assert kinds(steps) == ["Open", "Read", "Tell", "Read", "Tell", "Read"]
    assert steps[0] == Open(WATCH_SYSTEM_STATUS, 0.5, newest_only=True)
    assert steps[2] == Tell(STATUS)


def test_silence_is_an_outage_later_than_the_gateways_sign_of_life(driver: Driver) -> None:
    steps = driver.run(driver.followings.status(3.0), STATUS)
    assert steps[1].within_s == OPTIONS.answer_within_s, "the first comes at once"
    assert steps[-1].within_s == 3.0 + OPTIONS.answer_within_s


def test_a_robot_that_went_away_is_told_and_tried_again_with_growing_pauses(driver: Driver) -> None:
    steps = driver.run(driver.followings.status(0.1), STATUS, *[GONE] * 5, STATUS, GONE)
    outages = [step.item.attempt for step in steps if isinstance(step, Tell) and step.item is not STATUS]
    assert outages == [1, 2, 3, 4, 5, 1]
    pauses = [step.seconds for step in steps if isinstance(step, Pause)]
    assert pauses == pytest.approx([0.1, 0.2, 0.4, 0.4, 0.4, 0.1])
    assert driver.followings.reconnects == 6


def test_a_robot_that_never_answered_is_given_up(driver: Driver) -> None:
    with pytest.raises(Unreachable):
        driver.run(driver.followings.status(0.1), *[GONE] * 20)
    assert driver.now_s <= 1.0


@pytest.mark.parametrize("trouble", [DeadlineExceeded("silent"), Overloaded("too much")])
def test_silence_and_a_full_gateway_are_outages(driver: Driver, trouble: GatewayError) -> None:
    steps = driver.run(driver.followings.status(0.1), STATUS, trouble)
    assert Tell(Outage(trouble, 1)) in steps


def test_what_asking_again_cannot_mend_ends_it(driver: Driver) -> None:
    with pytest.raises(InvalidRequest):
        driver.run(driver.followings.events(EventFeed()), InvalidRequest("no such place"))


def test_events_go_on_where_they_stopped(driver: Driver) -> None:
    here = CaughtUp(position=EventPosition("run", 7))
    steps = driver.run(driver.followings.events(EventFeed()), here, GONE)
    opened = [step for step in steps if isinstance(step, Open)]
    assert [each.method for each in opened] == [SUBSCRIBE_EVENTS] * 2
    assert [each.request.after for each in opened] == [None, EventPosition("run", 7)]
    assert not opened[0].newest_only


def test_a_gateway_that_cannot_be_watched_is_asked(driver: Driver) -> None:
    following = driver.followings.status(0.5)
    steps = driver.run(following, Unsupported("older"), None, GONE, None)
    asked = steps[2:]
    assert kinds(asked) == ["Send", "Tell", "Pause", "Send", "Tell", "Pause", "Send", "Tell", "Pause", "Send"]
    assert asked[0].method is GET_SYSTEM_STATUS
    assert asked[2] == Pause(0.5)
    assert asked[4] == Tell(Outage(GONE, 1))


def test_who_wants_it_more_slowly_than_any_gateway_tells_asks(driver: Driver) -> None:
    assert isinstance(driver.run(driver.followings.status(61.0))[0], Send)
