"""Deadlines and retries of unary calls: no gRPC, no waiting."""

from collections.abc import Awaitable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import pytest

from console.client import (
    Backoff,
    Camera,
    CameraState,
    ClientOptions,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    SystemStatus,
)
from console.client.errors import DeadlineExceeded, GatewayError, Refused, Unreachable
from console.client.mapping.methods import (
    GET_SYSTEM_STATUS,
    NO_FIELDS,
    SET_PREVIEW_MODE,
    DesiredPreview,
    Method,
    preview_request,
)
from console.client.unary import UnaryCalls

STATUS = GET_SYSTEM_STATUS.decode(b"")
GONE = Unreachable("gone")

T = TypeVar("T")


@dataclass
class Send:
    """One attempt."""

    method: Method[Any]
    request: Any
    timeout_s: float


class Stage:
    """A transport that plays outcomes, and a clock that moves only when a step takes time."""

    def __init__(self, options: ClientOptions | None = None) -> None:
        self.now_s = 100.0
        self.calls = UnaryCalls(self, options or ClientOptions(), clock=lambda: self.now_s)
        self.sends: list[Send] = []
        self.pauses_s: list[float] = []

    async def call(self, method: Method[Any], request: Any, timeout_s: float) -> Any:
        self.sends.append(Send(method, request, timeout_s))
        self.now_s += self.each_takes_s
        outcome = self.outcomes.pop(0) if self.outcomes else GONE
        if isinstance(outcome, GatewayError):
            raise outcome
        return outcome

    async def sleep(self, seconds: float) -> None:
        self.pauses_s.append(seconds)
        self.now_s += seconds

    async def play(self, work: Awaitable[T], *outcomes: object, each_takes_s: float = 0.0) -> T:
        """Answers each attempt with the next outcome; returns the result."""
        self.outcomes = list(outcomes)
        self.each_takes_s = each_takes_s
        return await work


def preview_change(state: PreviewState, *, accepted: bool = True, profile: str = "balanced") -> PreviewChange:
    return PreviewChange(accepted=accepted, message="", preview=with_preview(state, profile).preview)


def with_preview(state: PreviewState, profile: str = "balanced") -> SystemStatus:
    preview = replace(STATUS.preview, state=state, profile=PreviewProfile(profile))
    return replace(STATUS, preview=preview)


async def test_an_answer_ends_the_call() -> None:
    stage = Stage()
    assert await stage.play(stage.calls.read(GET_SYSTEM_STATUS), STATUS) is STATUS
    assert [send.timeout_s for send in stage.sends] == [2.0]
    assert stage.calls.retries == 0


async def test_a_robot_that_comes_back_is_asked_again() -> None:
    stage = Stage()
    assert await stage.play(stage.calls.read(GET_SYSTEM_STATUS), GONE, GONE, STATUS) is STATUS
    assert stage.pauses_s == [0.1, 0.2]
    assert stage.calls.retries == 2


async def test_pauses_grow_to_a_limit_and_end() -> None:
    stage = Stage()
    with pytest.raises(Unreachable):
        await stage.play(stage.calls.read(GET_SYSTEM_STATUS))
    assert stage.pauses_s == [0.1, 0.2, 0.4]  # a further one would begin after the first second
    assert stage.calls.retries == 3


async def test_attempts_share_one_deadline() -> None:
    stage = Stage(ClientOptions(answer_within_s=2.0))
    with pytest.raises(Unreachable):
        await stage.play(stage.calls.read(GET_SYSTEM_STATUS), each_takes_s=0.3)
    assert [round(send.timeout_s, 6) for send in stage.sends] == [2.0, 1.6, 1.1]


async def test_a_deadline_shorter_than_the_patience_ends_it() -> None:
    options = ClientOptions(answer_within_s=0.25, backoff=Backoff(first_s=0.1, give_up_after_s=60))
    stage = Stage(options)
    with pytest.raises(Unreachable):
        await stage.play(stage.calls.read(GET_SYSTEM_STATUS))
    assert stage.pauses_s == [0.1]


@pytest.mark.parametrize("error", [Refused("no"), DeadlineExceeded("late")])
async def test_only_an_unreachable_robot_is_asked_again(error: GatewayError) -> None:
    stage = Stage()
    with pytest.raises(type(error)):
        await stage.play(stage.calls.read(GET_SYSTEM_STATUS), error)
    assert len(stage.sends) == 1


async def test_what_must_not_happen_twice_is_not_asked_twice() -> None:
    once = replace(GET_SYSTEM_STATUS, idempotent=False)
    stage = Stage()
    with pytest.raises(Unreachable):
        await stage.play(stage.calls.call(once, NO_FIELDS, 2.0))
    assert len(stage.sends) == 1


async def test_enabling_watches_until_frames_leave() -> None:
    stage = Stage()
    request = DesiredPreview(True, PreviewProfile.BALANCED)
    change = await stage.play(
        stage.calls.set_preview(request, 10),
        preview_change(PreviewState.STARTING),
        with_preview(PreviewState.STARTING),
        with_preview(PreviewState.RUNNING),
    )
    assert isinstance(change, PreviewChange)
    assert change.preview.state is PreviewState.RUNNING
    assert [send.method for send in stage.sends] == [SET_PREVIEW_MODE, GET_SYSTEM_STATUS, GET_SYSTEM_STATUS]
    assert stage.sends[0].request == preview_request(request)


@pytest.mark.parametrize(
    ("request_", "state", "profile", "settled"),
    [
        (DesiredPreview(True), PreviewState.RUNNING, "low-bw", True),
        (DesiredPreview(True, PreviewProfile.BALANCED), PreviewState.RUNNING, "balanced", True),
        (DesiredPreview(True, PreviewProfile.BALANCED), PreviewState.RUNNING, "low-bw", False),
        (DesiredPreview(True), PreviewState.FAULTED, "balanced", True),
        (DesiredPreview(True), PreviewState.DISABLED, "balanced", False),
        (DesiredPreview(False), PreviewState.DISABLED, "balanced", True),
        (DesiredPreview(False), PreviewState.STOPPING, "balanced", False),
        (DesiredPreview(False), PreviewState.RUNNING, "balanced", False),
    ],
)
async def test_when_a_request_is_settled(
    request_: DesiredPreview, state: PreviewState, profile: str, settled: bool
) -> None:
    stage = Stage()
    await stage.play(
        stage.calls.set_preview(request_, 0.05),
        preview_change(state, profile=profile),
        with_preview(state, profile),
    )
    assert (len(stage.sends) == 1) is settled


@pytest.mark.parametrize(
    ("state", "settled"),
    [
        (CameraState.LIVE, True),
        (CameraState.FAILED, True),
        (CameraState.STARTING, False),
        (CameraState.READY, False),
    ],
)
async def test_when_a_request_for_a_camera_is_settled(state: CameraState, settled: bool) -> None:
    stage = Stage()
    change, status = preview_change(PreviewState.RUNNING), with_preview(PreviewState.RUNNING)
    camera = Camera(name="rear", state=state, error="", fallback="")
    change = replace(change, preview=replace(change.preview, cameras=(camera,)))
    status = replace(status, preview=replace(status.preview, cameras=(camera,)))
    await stage.play(stage.calls.set_preview(DesiredPreview(True, camera="rear"), 0.05), change, status)
    assert (len(stage.sends) == 1) is settled


async def test_a_preview_that_never_settles_is_given_back_as_it_is() -> None:
    stage = Stage()
    starting = [with_preview(PreviewState.STARTING)] * 100
    change = await stage.play(
        stage.calls.set_preview(DesiredPreview(True), 1.0), preview_change(PreviewState.STARTING), *starting
    )
    assert isinstance(change, PreviewChange)
    assert change.preview.state is PreviewState.STARTING
    assert len(stage.sends) <= 12


async def test_a_refused_request_is_not_watched() -> None:
    stage = Stage()
    refused = preview_change(PreviewState.DISABLED, accepted=False)
    assert await stage.play(stage.calls.set_preview(DesiredPreview(True), 10), refused) is refused
    assert len(stage.sends) == 1
