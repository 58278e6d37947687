"""Control actions are events: who asked for what, from where, and what became of it."""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from google.protobuf import text_format
from google.protobuf.message import Message

from common.errors import DomainError
from common.rpc import Context
from gateway.rpc.peer import address_of
from gateway.rpc.tally import Behavior
from gateway.status.event import ControlAction, ControlResult, News
from gateway.status.fault import Severity

_COMPONENT: Final = "gateway"
_LONGEST_WORDS: Final = 200
"""Characters of a request or an answer in an event: a request may be as long as its sender likes."""


def nobody(_context: Context) -> str:
    """Who calls, where the gateway doesn't ask."""
    return ""


def unrecorded(_action: ControlAction) -> None:
    """Events are all there is."""


class Controls:
    """Tells of control actions.

    Args:
        note: takes the news.
        who: names the caller of a call; empty when nobody knows.
        record: takes the action for good; events are forgotten some day.
    """

    def __init__(
        self,
        note: Callable[[News], None],
        who: Callable[[Context], str] = nobody,
        record: Callable[[ControlAction], None] = unrecorded,
    ) -> None:
        self._note = note
        self._who = who
        self._record = record

    def told(self, method: str, behavior: Behavior, reply_type: type[Message]) -> Behavior:
        """The same behavior; whatever becomes of a call is an event."""

        async def call(request: Any, context: Context) -> bytes:
            def tell(result: ControlResult, answer: str) -> None:
                asked = _shortened(_words(request))
                address = address_of(context.peer())
                self._tell(
                    ControlAction(self._who(context), address, method, asked, result, _shortened(answer))
                )

            try:
                reply = await behavior(request, context)
            except asyncio.CancelledError:
                tell(ControlResult.ACCEPTED, "the caller left before the answer")
                raise
            except DomainError as error:
                tell(ControlResult.REFUSED, str(error))
                raise
            except Exception:
                tell(ControlResult.FAILED, "internal error; the robot's log says more")
                raise
            tell(ControlResult.ACCEPTED, getattr(reply_type.FromString(reply), "message", ""))
            return reply

        return call

    def _tell(self, action: ControlAction) -> None:
        self._record(action)
        self._note(action_news(action))


def action_news(action: ControlAction) -> News:
    """What operators are told of it."""
    who, asked = action.who or action.address, action.request or "nothing more"
    words = f"{who} asked for {action.method} ({asked}), {action.result.value}: {action.answer}"
    severity = Severity.INFO if action.result is ControlResult.ACCEPTED else Severity.WARNING
    return News(severity, _COMPONENT, words, action)


def _words(request: Message) -> str:
    """As text. What is at its default is left out, but for what is false: to switch off is an order, too."""
    orders = [
        f"{each.name}: false"
        for each in request.DESCRIPTOR.fields
        if each.type == each.TYPE_BOOL and not (each.has_presence or getattr(request, each.name))
    ]
    rest = text_format.MessageToString(request, as_one_line=True)
    return " ".join([*orders, rest] if rest else orders)


def _shortened(words: str) -> str:
    return words if len(words) <= _LONGEST_WORDS else f"{words[: _LONGEST_WORDS - 3]}..."
