"""The policy of both clients, played by hand: no gRPC, no waiting."""

from dataclasses import replace

import pytest

from console.client import Backoff, ClientOptions, PreviewChange, PreviewProfile, PreviewState, SystemStatus
from console.client.errors import DeadlineExceeded, GatewayError, Refused, Unreachable
from console.client.exchange import Done, Exchange, Exchanges, Pause, Send, Step, advance
from console.client.mapping.methods import GET_SYSTEM_STATUS, SET_PREVIEW_MODE, Method, PreviewWish

STATUS = GET_SYSTEM_STATUS.decode(b"")
GONE = Unreachable("gone")


class Stage:
    """A clock that moves only when a step takes time, and the steps that were taken."""

    def __init__(self, options: ClientOptions | None = None) -> None:
        self.now_s = 100.0
        self.exchanges = Exchanges(options or ClientOptions(), clock=lambda: self.now_s)
        self.steps: list[Step] = []

    def play(self, exchange: Exchange[object], *outcomes: object, each_takes_s: float = 0.0) -> object:
        """Answers each Send with the next outcome; returns the result."""
        left = list(outcomes)
        step = advance(exchange, None)
        while not isinstance(step, Done):
            self.steps.append(step)
            if isinstance(step, Pause):
                self.now_s += step.seconds
                step = advance(exchange, None)
            else:
                self.now_s += each_takes_s
                step = advance(exchange, left.pop(0) if left else GONE)
        return step.result

    @property
    def pauses_s(self) -> list[float]:
        return [step.seconds for step in self.steps if isinstance(step, Pause)]

    @property
    def sends(self) -> list[Send[object, object]]:
        return [step for step in self.steps if isinstance(step, Send)]


def preview_change(state: PreviewState, *, accepted: bool = True, profile: str = "balanced") -> PreviewChange:
    return PreviewChange(accepted=accepted, message="", preview=with_preview(state, profile).preview)


def with_preview(state: PreviewState, profile: str = "balanced") -> SystemStatus:
    preview = replace(STATUS.preview, state=state, profile=PreviewProfile(profile))
    return replace(STATUS, preview=preview)


def test_an_answer_ends_the_exchange() -> None:
    stage = Stage()
    assert stage.play(stage.exchanges.status(), STATUS) is STATUS
    assert [send.timeout_s for send in stage.sends] == [2.0]
    assert stage.exchanges.retries == 0


def test_a_robot_that_comes_back_is_asked_again() -> None:
    stage = Stage()
    assert stage.play(stage.exchanges.status(), GONE, GONE, STATUS) is STATUS
    assert stage.pauses_s == [0.1, 0.2]
    assert stage.exchanges.retries == 2


def test_pauses_grow_to_a_limit_and_end() -> None:
    stage = Stage()
    with pytest.raises(Unreachable):
        stage.play(stage.exchanges.status())
    assert stage.pauses_s == [0.1, 0.2, 0.4]  # a further one would begin after the first second
    assert stage.exchanges.retries == 3


def test_attempts_share_one_deadline() -> None:
    stage = Stage(ClientOptions(answer_within_s=2.0))
    with pytest.raises(Unreachable):
        stage.play(stage.exchanges.status(), each_takes_s=0.3)
    assert [round(send.timeout_s, 6) for send in stage.sends] == [2.0, 1.6, 1.1]


def test_a_deadline_shorter_than_the_patience_ends_it() -> None:
    options = ClientOptions(answer_within_s=0.25, backoff=Backoff(first_s=0.1, give_up_after_s=60))
    stage = Stage(options)
    with pytest.raises(Unreachable):
        stage.play(stage.exchanges.status())
    assert stage.pauses_s == [0.1]


@pytest.mark.parametrize("error", [Refused("no"), DeadlineExceeded("late")])
def test_only_an_unreachable_robot_is_asked_again(error: GatewayError) -> None:
    stage = Stage()
    with pytest.raises(type(error)):
        stage.play(stage.exchanges.status(), error)
    assert len(stage.sends) == 1


def test_what_must_not_happen_twice_is_not_asked_twice() -> None:
    once: Method[None, str] = Method("DriveOneMetre", lambda _: b"", lambda _: "", idempotent=False)
    stage = Stage()
    with pytest.raises(Unreachable):
        stage.play(stage.exchanges.ask(once, None, 2.0))
    assert len(stage.sends) == 1


def test_enabling_watches_until_frames_leave() -> None:
    stage = Stage()
    wish = PreviewWish(True, PreviewProfile.BALANCED)
    change = stage.play(
        stage.exchanges.set_preview(wish, 10),
        preview_change(PreviewState.STARTING),
        with_preview(PreviewState.STARTING),
        with_preview(PreviewState.RUNNING),
    )
    assert isinstance(change, PreviewChange)
    assert change.preview.state is PreviewState.RUNNING
    assert [send.method for send in stage.sends] == [SET_PREVIEW_MODE, GET_SYSTEM_STATUS, GET_SYSTEM_STATUS]
    assert stage.sends[0].request == wish


@pytest.mark.parametrize(
    ("wish", "state", "profile", "settled"),
    [
        (PreviewWish(True), PreviewState.RUNNING, "low-bw", True),
        (PreviewWish(True, PreviewProfile.BALANCED), PreviewState.RUNNING, "balanced", True),
        (PreviewWish(True, PreviewProfile.BALANCED), PreviewState.RUNNING, "low-bw", False),
        (PreviewWish(True), PreviewState.FAULTED, "balanced", True),
        (PreviewWish(True), PreviewState.DISABLED, "balanced", False),
        (PreviewWish(False), PreviewState.DISABLED, "balanced", True),
        (PreviewWish(False), PreviewState.STOPPING, "balanced", False),
        (PreviewWish(False), PreviewState.RUNNING, "balanced", False),
    ],
)
def test_when_a_wish_is_settled(wish: PreviewWish, state: PreviewState, profile: str, settled: bool) -> None:
    stage = Stage()
    stage.play(
        stage.exchanges.set_preview(wish, 0.05),
        preview_change(state, profile=profile),
        with_preview(state, profile),
    )
    assert (len(stage.sends) == 1) is settled


def test_a_preview_that_never_settles_is_given_back_as_it_is() -> None:
    stage = Stage()
    starting = [with_preview(PreviewState.STARTING)] * 100
    change = stage.play(
        stage.exchanges.set_preview(PreviewWish(True), 1.0), preview_change(PreviewState.STARTING), *starting
    )
    assert isinstance(change, PreviewChange)
    assert change.preview.state is PreviewState.STARTING
    assert len(stage.sends) <= 12


def test_a_refused_wish_is_not_watched() -> None:
    stage = Stage()
    refused = preview_change(PreviewState.DISABLED, accepted=False)
    assert stage.play(stage.exchanges.set_preview(PreviewWish(True), 10), refused) is refused
    assert len(stage.sends) == 1
