"""Records every control action: who asked for what, from where, and with what result."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final

from google.protobuf import text_format
from google.protobuf.message import Message

from common import request_id
from common.errors import DomainError, TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.access.address_prefix import address_prefix, host_of
from gateway.access.repeats import Repeats
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method
from gateway.rpc.calls.ports import AuditSink, EventSink
from gateway.status.event import ControlAction, ControlResult, Event
from gateway.status.fault import Severity
from gateway.status.preview import Profile

_COMPONENT: Final = "gateway"
_MAX_TEXT: Final = 200
"""Characters of a request or an answer: a request may be as long as its sender likes."""
HUB: Final = "hub"
"""The address of what the fleet's hub requests."""
_NOW_S: Final = 1.0
"""Age of an action whose event has its time, near enough."""


class Audit(Interceptor[CallContext]):
    """Records control actions, and those that `Auth` and `Authorization`, further in, refused.

    Args:
        events: operators see the actions there.
        done: keeps those that may have changed the robot.
        refused: keeps the refused ones, which no number of them can push out of `done`.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        events: EventSink,
        done: AuditSink,
        refused: AuditSink,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._events = events
        self._done = Repeats(partial(self._write, done), clock)
        self._refused = Repeats(partial(self._write, refused), clock)
        self._moved = Repeats(partial(self._write, done), clock)
        self._strangers = Repeats(self._note, clock, max_kinds=0)
        """For the events of refused strangers, all of them as one caller that does one thing: there may be
        more addresses than the ring of events has places."""

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is a control action."""
        return method.changes_robot

    def on_response(self, call: CallContext, response: Any) -> None:
        """Keeps the answer until the call ends."""
        call.response = response

    def record_start(self, call: CallContext) -> None:
        """Records that a stream has begun, whose end may be hours away."""
        self._record(call, ControlResult.ACCEPTED, "started")

    def on_end(self, call: CallContext, error: BaseException | None) -> None:
        """Records how the action ended.

        Left out are refusals for a rate or a lockout, and calls that ended before they were admitted or
        refused: a caller that leaves while it is authenticated has done nothing.
        """
        if isinstance(error, asyncio.CancelledError) and call.refusal:
            error = call.refusal  # the caller has left while it was delayed
        if error is None:
            self._record(call, ControlResult.ACCEPTED, _answer(call))
        elif isinstance(error, TooMuchError) and error.reason is not Reason.MESSAGE_TOO_LARGE:
            return
        elif isinstance(error, DomainError):
            self._record(call, ControlResult.REFUSED, str(error))
        elif call.request is None:
            return
        elif isinstance(error, asyncio.CancelledError):
            self._record(call, ControlResult.ACCEPTED, "the caller left before the answer")
        else:
            self._record(call, ControlResult.FAILED, "internal error; see the robot's log")

    def record_action(self, action: ControlAction) -> None:
        """Records what a caller did in a stream: a time of motion.

        Repeated ones are folded apart from calls, with the sum of what was moved: a driver may hold and
        release sixty times a second.
        """
        self._moved.take(action, address_prefix(host_of(action.address)))

    def record_request_of_hub(
        self,
        who: str,
        method: str,
        request: Message | None,
        *,
        result: ControlResult,
        answer: str,
        own_id: str,
    ) -> None:
        """Records what the fleet's hub has requested, as of one caller: the names are the hub's to choose.

        Args:
            who: by the hub's word.
            method: of the contract that does the same.
            request: of that method; None for one that this gateway does not know.
            result: how it ended.
            answer: for people.
            own_id: its request ID.
        """
        action = ControlAction(
            who=who,
            address=HUB,
            method=method,
            request=_shortened(_as_text(request)) if request else "",
            result=result,
            answer=_shortened(answer),
            request_id=own_id,
        )
        self._repeats(result).take(action, HUB, authenticated=False)

    def record_due(self) -> None:
        """Records repeated actions whose time has come; to be called a few times a second."""
        for each in self._all:
            each.record_due()

    def record_all(self) -> None:
        """Records the repeated actions that are still only counted, at the end of the program."""
        for each in self._all:
            each.record_all()

    @property
    def _all(self) -> tuple[Repeats, ...]:
        return self._done, self._refused, self._moved, self._strangers

    def _record(self, call: CallContext, result: ControlResult, answer: str) -> None:
        principal = call.principal
        action = ControlAction(
            who=principal.name if principal else "",
            address=call.peer.address,
            method=call.method.name,
            request=_shortened(_as_text(call.request)) if call.request else "",
            result=result,
            answer=_shortened(answer),
            role=principal.role.value if principal else "",
            credential=principal.credential_ids[0] if principal else "",
            request_id=request_id.current(),
        )
        self._repeats(result).take(action, call.peer.address_prefix)
        if _is_strangers_refusal(action):
            self._strangers.take(action, "")

    def _repeats(self, result: ControlResult) -> Repeats:
        return self._refused if result is ControlResult.REFUSED else self._done

    def _write(self, sink: AuditSink, action: ControlAction) -> None:
        sink.record(action)
        if not _is_strangers_refusal(action):
            self._note(action)

    def _note(self, action: ControlAction) -> None:
        self._events.note(_event(action))


class AuditStart(Interceptor[CallContext]):
    """Records the start of control streams. Further in than validation, which has parsed the request.

    Args:
        audit: records their end.
    """

    def __init__(self, audit: Audit) -> None:
        self._audit = audit
        self._started: set[CallContext] = set()

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is a control action that lasts."""
        return method.changes_robot and method.streaming

    def on_request(self, call: CallContext, request: Any) -> Any:
        """Records the first valid request."""
        if call not in self._started:
            self._started.add(call)
            self._audit.record_start(call)
        return request

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Forgets the call."""
        self._started.discard(call)


def _is_strangers_refusal(action: ControlAction) -> bool:
    return action.result is ControlResult.REFUSED and not action.who


def _answer(call: CallContext) -> str:
    response, response_type = call.response, call.method.response_type
    if isinstance(response, bytes) and response_type is not None:
        response = response_type.FromString(response)
    return getattr(response, "message", "") or ("ended" if call.method.streaming else "")


def _event(action: ControlAction) -> Event:
    """Returns the event that shows an action to operators; says when it happened if that is not now."""
    if action.count > 1 or time.time() - action.unix_s > _NOW_S:
        first, *_ = (*action.earlier_unix_s, action.unix_s)
        times = f"{_clock_time(first)} to {_clock_time(action.unix_s)} UTC"
        action = replace(action, answer=f"{action.answer} (calls: {action.count}, {times})")
    request = f" ({action.request})" if action.request else ""
    who = action.who or action.address
    message = f"{who} called {action.method}{request}, {action.result.value}: {action.answer}"
    severity = Severity.INFO if action.result is ControlResult.ACCEPTED else Severity.WARNING
    return Event(severity, _COMPONENT, message, action)


def _clock_time(unix_s: float) -> str:
    return f"{datetime.fromtimestamp(unix_s, UTC):%H:%M:%S}"


def _as_text(request: Message) -> str:
    """Fields at their default are left out, except for a bool: `enabled: false` is an order, too."""
    false = [
        f"{each.name}: false"
        for each in request.DESCRIPTOR.fields
        if each.type == each.TYPE_BOOL and not (each.has_presence or getattr(request, each.name))
    ]
    rest = text_format.MessageToString(request, as_one_line=True)
    for profile in Profile:
        rest = rest.replace(f"PREVIEW_PROFILE_{profile.name}", profile.value)
    return " ".join([*false, rest] if rest else false)


def _shortened(text: str) -> str:
    return text if len(text) <= _MAX_TEXT else f"{text[: _MAX_TEXT - 3]}..."
