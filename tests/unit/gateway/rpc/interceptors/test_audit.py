"""Every control action is recorded once: who, from where, what, and with what result."""

import asyncio
import re
import time
from contextlib import nullcontext
from typing import Any

import pytest

from common.errors import InvalidRequestError, NotAllowedError, NotAuthenticatedError, TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.access.credential import Principal
from gateway.access.repeats import BURST, MAX_KINDS, MAX_TIMES, WINDOW_S
from gateway.access.role import Role
from gateway.rpc.calls.call import CallContext
from gateway.rpc.interceptors.audit import Audit, AuditStart
from gateway.rpc.interceptors.validation import Validation
from gateway.status.event import ControlAction, ControlResult, Event, Motion
from gateway.status.event_log import CAPACITY
from gateway.status.fault import Severity
from gateway.status.teleop import DriveEpisode
from gateway.teleop.episodes import Episodes
from gateway.teleop.lease import Driver
from omniseer.gateway.v1.preview_pb2 import PREVIEW_PROFILE_LOW_BW
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SetPreviewModeResponse
from tests.support.calls import PEER, call_of, serve

ON = SetPreviewModeRequest(enabled=True)
CLOCK = r"\d\d:\d\d:\d\d"
ANNA = Principal("anna", Role.OPERATOR, ("a1",))


class Records:
    """A place where actions go."""

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
        self.now_s = 1000.0
        self.records, self.refused = Records(), Records()
        self.audit = Audit(self.records, self.records, self.refused, lambda: self.now_s)

    async def call(
        self,
        outcome: SetPreviewModeResponse | bytes | BaseException,
        request: bytes = ON.SerializeToString(),
        auth: Authenticated | None = None,
        method: str = "SetPreviewMode",
        peer: str = PEER,
    ) -> None:
        async def behavior(_request: Any, _call: CallContext) -> SetPreviewModeResponse | bytes:
            if isinstance(outcome, BaseException):
                raise outcome
            return outcome

        chain = [self.audit, auth or Authenticated(ANNA), Validation(10_000)]
        await serve(chain, method, behavior, request, peer=peer)


async def recorded(
    outcome: SetPreviewModeResponse | BaseException, request: bytes = ON.SerializeToString()
) -> ControlAction:
    """The one record that a call with this outcome makes, in its file and as an event."""
    ground = Ground()
    try:
        await ground.call(outcome, request)
    except (InvalidRequestError, ZeroDivisionError, asyncio.CancelledError) as error:
        assert error is outcome or not request, "the caller gets it all the same"  # noqa: PT017
    [event] = ground.records.events
    assert isinstance(event.detail, ControlAction)
    refused = event.detail.result is ControlResult.REFUSED
    assert (ground.records.actions, ground.refused.actions) == (
        ([], [event.detail]) if refused else ([event.detail], [])
    )
    return event.detail


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
            "enabled: false profile: low-bw",
        ),
        (
            SetPreviewModeRequest(enabled=True, profile=PREVIEW_PROFILE_LOW_BW),
            "enabled: true profile: low-bw",
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
    [action] = ground.refused.actions
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
    assert len(ground.refused.actions) == len(ground.records.events) == BURST
    assert {each.result for each in ground.refused.actions} == {ControlResult.REFUSED}
    assert ground.records.events[0].severity is Severity.WARNING


async def test_a_caller_that_is_locked_out_is_not_recorded() -> None:
    ground = Ground()
    with pytest.raises(TooMuchError):
        await ground.call(
            SetPreviewModeResponse(), auth=Authenticated(None, TooMuchError("wait", Reason.LOCKED_OUT))
        )
    assert ground.records.events == []


class Leaving(Interceptor[CallContext]):
    """In the place of Auth, while it reads the credentials: the caller leaves meanwhile."""

    def on_call(self, _call: CallContext) -> None:
        raise asyncio.CancelledError


async def test_a_caller_that_leaves_before_it_is_authenticated_has_done_nothing() -> None:
    ground = Ground()
    with pytest.raises(asyncio.CancelledError):
        await serve([ground.audit, Leaving(), Validation(10_000)], "SetPreviewMode", None)
    assert ground.records.actions == []
    assert ground.refused.actions == []
    assert ground.records.events == []


class LeavingWhileRefused(Interceptor[CallContext]):
    """In the place of Auth, while it delays a refusal: the caller leaves meanwhile."""

    def on_call(self, call: CallContext) -> None:
        call.refusal = NotAuthenticatedError("the token is unknown", Reason.CREDENTIAL_UNKNOWN)
        raise asyncio.CancelledError


async def test_a_caller_that_leaves_before_its_refusal_is_recorded_and_folded() -> None:
    ground = Ground()
    for _ in range(BURST + 5):
        with pytest.raises(asyncio.CancelledError):
            await serve([ground.audit, LeavingWhileRefused(), Validation(10_000)], "SetPreviewMode", None)
    assert ground.records.actions == []
    assert [each.answer for each in ground.refused.actions] == ["the token is unknown"] * BURST
    ground.audit.record_all()
    assert sum(each.count for each in ground.refused.actions) == BURST + 5


@pytest.mark.parametrize("refused", [True, False])
async def test_a_flood_fills_neither_log_nor_events_and_is_recorded_by_its_number(
    refused: bool,
) -> None:  # a case
    ground = Ground()
    log = ground.refused if refused else ground.records
    for _ in range(BURST + 20):
        with pytest.raises(InvalidRequestError) if refused else nullcontext():
            request = b"\xff" if refused else ON.SerializeToString()
            await ground.call(SetPreviewModeResponse(message="running"), request)
    assert len(log.actions) == len(ground.records.events) == BURST
    ground.now_s += WINDOW_S
    ground.audit.record_due()
    assert [each.count for each in log.actions] == [1] * BURST + [20]
    assert re.search(rf" \(calls: 20, {CLOCK} to {CLOCK} UTC\)$", ground.records.events[-1].message)
    assert len(ground.records.actions) + len(ground.refused.actions) == BURST + 1


async def test_refusals_of_strangers_at_70_addresses_leave_room_for_other_events() -> None:
    """Ten each, and eight kinds besides: in the file all of them, and more than the ring of events has."""
    ground, addresses, minutes = Ground(), 70, 10
    kinds = [*["no credential"] * BURST, *(f"kind {number}" for number in range(MAX_KINDS))]
    for _ in range(minutes):
        for number in range(addresses):
            for kind in kinds:
                auth = Authenticated(None, NotAuthenticatedError(kind, Reason.CREDENTIAL_UNKNOWN))
                with pytest.raises(NotAuthenticatedError):
                    await ground.call(SetPreviewModeResponse(), auth=auth, peer=f"ipv4:10.1.0.{number}:4")
        ground.now_s += WINDOW_S
        ground.audit.record_due()
    assert len(ground.refused.actions) > CAPACITY
    assert len(ground.records.events) <= BURST + minutes
    assert "10.1.0.69:4 and others called SetPreviewMode" in ground.records.events[-1].message
    ground.audit.record_all()
    shown = [each.detail for each in ground.records.events if isinstance(each.detail, ControlAction)]
    calls = minutes * addresses * len(kinds)
    assert sum(each.count for each in shown) == sum(each.count for each in ground.refused.actions) == calls


async def test_refusals_of_strangers_hold_no_event_of_a_name_back() -> None:
    ground = Ground()
    for principal in (*[None] * (BURST + 5), ANNA):
        with pytest.raises(NotAllowedError):
            await ground.call(SetPreviewModeResponse(), auth=Authenticated(principal, NotAllowedError("no")))
    assert len(ground.records.events) == BURST + 1
    assert ground.records.events[-1].message.startswith("anna called")


async def test_an_action_that_was_held_back_alone_is_an_event_with_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ground = Ground()
    for _ in range(BURST + 1):
        await ground.call(SetPreviewModeResponse(message="running"))
    late_s = time.time() + WINDOW_S
    monkeypatch.setattr(time, "time", lambda: late_s)
    ground.now_s += WINDOW_S
    ground.audit.record_due()
    event = ground.records.events[-1]
    assert re.search(rf"accepted: running \(calls: 1, {CLOCK} to {CLOCK} UTC\)$", event.message)
    assert ground.records.actions[-1].answer == "running"


async def test_refusals_hold_no_accepted_action_back() -> None:
    ground = Ground()
    for _ in range(BURST + 20):
        with pytest.raises(InvalidRequestError):
            await ground.call(SetPreviewModeResponse(), request=b"\xff")
    await ground.call(SetPreviewModeResponse())
    await ground.call(SetPreviewModeResponse())
    assert [each.count for each in ground.records.actions] == [1, 1]


async def test_what_is_only_counted_is_recorded_at_the_end() -> None:
    ground = Ground()
    for _ in range(BURST + 20):
        await ground.call(SetPreviewModeResponse())
    ground.audit.record_all()
    assert sum(each.count for each in ground.records.actions) == BURST + 20


async def test_looking_is_no_control_action() -> None:
    ground = Ground()
    await ground.call(SetPreviewModeResponse(), request=b"", method="Ping")
    assert ground.records.actions == []


async def test_long_texts_are_shortened() -> None:
    ground = Ground()
    await ground.call(SetPreviewModeResponse(message="x" * 5000))
    assert len(ground.records.events[0].message) < 600


def test_holds_without_end_are_folded_and_keep_what_was_moved() -> None:
    """Sixty a second, as the pacing passes them: they must not displace what others did."""
    ground = Ground()
    episodes = Episodes(ground.audit)
    episodes.note(Driver("anna", "anna", "10.0.0.9:4711", "operator", "cafe01"), "gamepad")
    episodes.note(Driver("ben", "ben", "10.0.0.8:4711", "operator", "cafe02"), "keyboard")
    for number in range(3600):
        ended_ns = time.monotonic_ns()
        driver = "anna" if number else "ben"
        ended = DriveEpisode(number, driver, ended_ns - 100_000_000, ended_ns, 0.01, 0.1, "released")
        episodes.record("process", ended)
    ground.audit.record_all()
    records = ground.records.actions
    assert len(records) <= 2 * BURST
    assert sum(each.count for each in records) == 3600
    assert [(each.who, each.request) for each in records[:2]] == [
        ("ben", "0.1 s, 0.01 m, 6 deg, by keyboard"),
        ("anna", "0.1 s, 0.01 m, 6 deg, by gamepad"),
    ]
    fold = records[-1]
    assert (fold.who, fold.answer, fold.credential) == ("anna", "released", "cafe01")
    assert fold.count == 3599 - BURST
    assert fold.request == f"{0.1 * fold.count:.1f} s, {0.01 * fold.count:.2f} m, 20563 deg, by gamepad"
    assert fold.motions == (Motion(0.1, 0.01, 0.1, "gamepad"),) * (MAX_TIMES + 1)


def test_motions_take_no_record_of_calls() -> None:
    ground = Ground()
    episodes = Episodes(ground.audit)
    episodes.note(Driver("anna", "anna", "10.0.0.9:4711", "operator", "cafe01"), "gamepad")
    for number in range(2 * BURST):
        ended_ns = time.monotonic_ns()
        reason = f"reason {number % 12}"
        episodes.record("process", DriveEpisode(number, "anna", ended_ns - 1000, ended_ns, 0.5, 0.0, reason))
    ground.audit.record_all()
    records = ground.records.actions
    metres = [float(re.findall(r"([\d.]+) m", each.request)[0]) for each in records]
    assert sum(metres) == pytest.approx(0.5 * 2 * BURST), "also of kinds that share a fold"
