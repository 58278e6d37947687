"""Whatever becomes of a control action, it is told: who, from where, what, and what came of it."""

import asyncio
from typing import Any

import pytest

from common.errors import NotNowError
from gateway.rpc.controls import Controls
from gateway.status.event import ControlAction, ControlResult, News
from gateway.status.fault import Severity
from omniseer.gateway.v1.preview_pb2 import PREVIEW_PROFILE_LOW_BW
from omniseer.gateway.v1.robot_gateway_pb2 import (
    SetPreviewModeRequest,
    SetPreviewModeResponse,
)

REQUEST = SetPreviewModeRequest(enabled=True)


class Call:
    """From a known place."""

    def peer(self) -> str:
        return "ipv4:10.0.0.5:41234"


async def told(outcome: bytes | BaseException, request: SetPreviewModeRequest = REQUEST) -> News:
    """The one piece of news that a call with this outcome makes."""
    news: list[News] = []

    async def behavior(_request: Any, _context: Any) -> bytes:
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    call = Controls(news.append, lambda _: "alice").told("SetPreviewMode", behavior, SetPreviewModeResponse)
    context: Any = Call()
    try:
        assert await call(request, context) == outcome
    except (NotNowError, ZeroDivisionError, asyncio.CancelledError) as error:
        assert error is outcome, "the caller gets it all the same"  # noqa: PT017  # passed on as it is
    [only] = news
    return only


async def test_an_accepted_action_has_the_robots_answer() -> None:
    news = await told(SetPreviewModeResponse(accepted=True, message="preview is running").SerializeToString())
    assert news.severity is Severity.INFO
    assert news.detail == ControlAction(
        "alice",
        "10.0.0.5:41234",
        "SetPreviewMode",
        "enabled: true",
        ControlResult.ACCEPTED,
        "preview is running",
    )


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (SetPreviewModeRequest(), "enabled: false"),
        (
            SetPreviewModeRequest(profile=PREVIEW_PROFILE_LOW_BW),
            "enabled: false profile: PREVIEW_PROFILE_LOW_BW",
        ),
        (
            SetPreviewModeRequest(enabled=True, profile=PREVIEW_PROFILE_LOW_BW),
            "enabled: true profile: PREVIEW_PROFILE_LOW_BW",
        ),
    ],
)
async def test_to_switch_off_is_told_as_plainly_as_to_switch_on(
    request_: SetPreviewModeRequest, words: str
) -> None:
    detail = (await told(b"", request_)).detail
    assert isinstance(detail, ControlAction)
    assert detail.request == words


@pytest.mark.parametrize(
    ("outcome", "result", "answer"),
    [
        (NotNowError("the robot is being serviced"), ControlResult.REFUSED, "being serviced"),
        (ZeroDivisionError("secret"), ControlResult.FAILED, "log says more"),
        (asyncio.CancelledError(), ControlResult.ACCEPTED, "left before the answer"),
    ],
)
async def test_what_goes_wrong_is_told_as_well(
    outcome: BaseException, result: ControlResult, answer: str
) -> None:
    detail = (await told(outcome)).detail
    assert isinstance(detail, ControlAction)
    assert detail.result is result
    assert answer in detail.answer
    assert "secret" not in detail.answer


async def test_nobody_fills_the_log_with_long_words() -> None:
    long = SetPreviewModeResponse(message="x" * 5000).SerializeToString()
    news = await told(long)
    assert len(news.message) < 600
