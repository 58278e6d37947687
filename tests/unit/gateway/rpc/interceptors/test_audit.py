"""Every control action is recorded once: who, from where, what, and with what result."""

import asyncio
from typing import Any

import pytest

from common.errors import InvalidRequestError, NotAllowedError, NotAuthenticatedError, TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.access.credential import Principal
from gateway.access.refusal_limiter import BURST, RefusalLimiter
from gateway.access.role import Role
from gateway.rpc.calls.call import CallContext
from gateway.rpc.interceptors.audit import Audit, AuditStart
from gateway.rpc.interceptors.validation import Validation
from gateway.status.event import ControlAction, ControlResult, Event
from gateway.status.fault import Severity
from omniseer.gateway.v1.preview_pb2 import PREVIEW_PROFILE_LOW_BW
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SetPreviewModeResponse
from tests.support.calls import call_of, serve

ON = SetPreviewModeRequest(enabled=True)
ANNA = Principal("anna", Role.OPERATOR, ("a1",))


class Records:
    """Both places where actions go."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.actions: list[ControlAction] = []

    def note(self, event: Event) -> None:
        self.events.append(event)

    def record(self, action: ControlAction) -> None:
        self.actions.append(action)


class Authenticated(Interceptor[CallContext]):
    """In the place of Auth."""

    def __init__(self, principal: Principal | None, error: Exception | None = None) -> None:
        self._principal, self._error = principal, error

    def on_call(self, call: CallContext) -> None:
        call.principal = self._principal
        if self._error:
            raise self._error


class Ground:
    """An audit interceptor between its neighbours."""

    def __init__(self) -> None:
        self.records = Records()
        self.audit = Audit(self.records, self.records, RefusalLimiter())

    async def call(
        self,
        outcome: SetPreviewModeResponse | bytes | BaseException,
        request: bytes = ON.SerializeToString(),
        auth: Authenticated | None = None,
        method: str = "SetPreviewMode",
    ) -> None:
        async def behavior(_request: Any, _call: CallContext) -> SetPreviewModeResponse | bytes:
            if isinstance(outcome, BaseException):
                raise outcome
            return outcome

        chain = [self.audit, auth or Authenticated(ANNA), Validation(10_000)]
        await serve(chain, method, behavior, request)


async def recorded(
    outcome: SetPreviewModeResponse | BaseException, request: bytes = ON.SerializeToString()
) -> ControlAction:
    """The one record that a call with this outcome makes, the same in both places."""
    ground = Ground()
    try:
        await ground.call(outcome, request)
    except (InvalidRequestError, ZeroDivisionError, asyncio.CancelledError) as error:
        assert error is outcome or not request, "the caller gets it all the same"  # noqa: PT017
    [action] = ground.records.actions
    [event] = ground.records.events
    assert event.detail is action
    return action


async def test_an_accepted_action_has_the_robots_answer() -> None:
    action = await recorded(SetPreviewModeResponse(accepted=True, message="preview is running"))
    assert action == ControlAction(
        who="anna",
        address="10.0.0.5:41234",
        method="SetPreviewMode",
        request="enabled: true",
        result=ControlResult.ACCEPTED,
        answer="preview is running",
        role="operator",
        credential="a1",
        request_id=action.request_id,
    )
    assert action.request_id


async def test_a_serialised_answer_is_recorded_as_well() -> None:
    ground = Ground()
    await ground.call(SetPreviewModeResponse(message="preview is running").SerializeToString())
    assert [each.answer for each in ground.records.actions] == ["preview is running"]


def control_stream() -> CallContext:
    stream = call_of("SetPreviewMode", request_streaming=True)
    stream.principal = ANNA
    return stream


def test_a_control_stream_is_recorded_when_it_starts_and_when_it_ends() -> None:
    ground, stream = Ground(), control_stream()
    start = AuditStart(ground.audit)
    assert start.applies_to(stream.method)
    stream.request = ON
    for _ in range(3):
        start.on_request(stream, ON)
    [first] = ground.records.actions
    assert (first.who, first.request, first.answer) == ("anna", "enabled: true", "started")
    ground.audit.on_end(stream, None)
    start.on_end(stream, None)
    assert [each.answer for each in ground.records.actions] == ["started", "ended"]


def test_a_single_control_action_has_no_start() -> None:
    assert not AuditStart(Ground().audit).applies_to(call_of("SetPreviewMode").method)
    assert not AuditStart(Ground().audit).applies_to(call_of("WatchSystemStatus", streaming=True).method)


@pytest.mark.parametrize(
    ("request_", "text"),
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
async def test_switching_off_is_recorded_as_plainly_as_switching_on(
    request_: SetPreviewModeRequest, text: str
) -> None:
    assert (await recorded(SetPreviewModeResponse(), request_.SerializeToString())).request == text


@pytest.mark.parametrize(
    ("outcome", "result", "answer"),
    [
        (InvalidRequestError("the robot is being serviced"), ControlResult.REFUSED, "being serviced"),
        (ZeroDivisionError("secret"), ControlResult.FAILED, "see the robot's log"),
        (asyncio.CancelledError(), ControlResult.ACCEPTED, "left before the answer"),
    ],
)
async def test_errors_are_recorded_as_well(
    outcome: BaseException, result: ControlResult, answer: str
) -> None:
    action = await recorded(outcome)
    assert action.result is result
    assert answer in action.answer
    assert "secret" not in action.answer


async def test_a_request_that_breaks_the_rules_is_recorded() -> None:
    ground = Ground()
    with pytest.raises(InvalidRequestError):
        await ground.call(SetPreviewModeResponse(), request=b"\xff")
    [action] = ground.records.actions
    assert action.result is ControlResult.REFUSED
    assert "can't be parsed" in action.answer


@pytest.mark.parametrize(
    "error",
    [
        NotAuthenticatedError("the token is unknown", Reason.CREDENTIAL_UNKNOWN),
        NotAllowedError("anna is viewer"),
    ],
)
async def test_what_auth_refuses_is_recorded_until_there_are_too_many(error: Exception) -> None:
    ground = Ground()
    for _ in range(BURST + 5):
        with pytest.raises(type(error)):
            await ground.call(SetPreviewModeResponse(), auth=Authenticated(None, error))
    assert len(ground.records.actions) == len(ground.records.events) == BURST
    assert {each.result for each in ground.records.actions} == {ControlResult.REFUSED}
    assert ground.records.events[0].severity is Severity.WARNING


async def test_a_caller_that_is_locked_out_is_not_recorded() -> None:
    ground = Ground()
    with pytest.raises(TooMuchError):
        await ground.call(
            SetPreviewModeResponse(), auth=Authenticated(None, TooMuchError("wait", Reason.LOCKED_OUT))
        )
    assert ground.records.actions == []


class Leaving(Interceptor[CallContext]):
    """In the place of Auth, while it reads the credentials: the caller leaves meanwhile."""

    def on_call(self, _call: CallContext) -> None:
        raise asyncio.CancelledError


async def test_a_caller_that_leaves_before_it_is_authenticated_has_done_nothing() -> None:
    ground = Ground()
    with pytest.raises(asyncio.CancelledError):
        await serve([ground.audit, Leaving(), Validation(10_000)], "SetPreviewMode", None)
    assert ground.records.actions == []
    assert ground.records.events == []


async def test_a_flood_of_refused_requests_fills_neither_log_nor_events() -> None:
    ground = Ground()
    for _ in range(BURST + 20):
        with pytest.raises(InvalidRequestError):
            await ground.call(SetPreviewModeResponse(), request=b"\xff")
    assert len(ground.records.actions) == len(ground.records.events) == BURST


async def test_looking_is_no_control_action() -> None:
    ground = Ground()
    await ground.call(SetPreviewModeResponse(), request=b"", method="Ping")
    assert ground.records.actions == []


async def test_long_texts_are_shortened() -> None:
    ground = Ground()
    await ground.call(SetPreviewModeResponse(message="x" * 5000))
    assert len(ground.records.events[0].message) < 600
