"""Limits of each connection: requests a second, open streams, and how many connections there may be."""

from collections.abc import Awaitable
from contextlib import suppress
from typing import Any

from common.errors import TooMuchError
from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.refusal_delay import RefusalDelay


class RateLimit(Interceptor[CallContext]):
    """Refuses calls beyond a connection's share with a delay; accounts for open streams.

    Each message of a request stream takes a token like a call, except for those of Drive, which has its own
    limit: a client that polls as often as it may must not end its own driving. A stop is never refused,
    unless its caller is unknown.

    Args:
        admission: the account of connections.
        refusals: delays refusals.
        admits: whether a call within the limits is admitted; False where callers are authenticated after.
    """

    def __init__(self, admission: Admission, refusals: RefusalDelay, *, admits: bool) -> None:
        self._admission = admission
        self._refusals = refusals
        self._admits = admits

    def on_call(self, call: CallContext) -> Awaitable[None] | None:
        """Takes a token, and a stream if the call is one.

        Raises:
            TooMuchError: there is none left; from the awaitable, after a delay.
        """
        if call.unlimited:
            if self._admits:
                with suppress(TooMuchError):
                    self._admission.admit(call.peer)
            return None
        try:
            self._admission.take_token(call.peer, call.method.name)
            if self._admits:
                self._admission.admit(call.peer)
            if call.method.streaming:
                self._admission.open_stream(call.peer)
        except TooMuchError as error:
            if self._refusals.full:
                self._admission.note_excess(call.peer)
            return self._refusals.refuse(error, call.waited_s)
        return None

    def on_request(self, call: CallContext, request: Any) -> Any:
        """Takes a token for a message of a request stream.

        Raises:
            TooMuchError: there is none left. It ends the stream at once; opening another one is delayed.
        """
        if call.method.request_streaming and not call.method.of_contract:
            self._admission.take_token(call.peer)
        return request

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Gives the stream back."""
        if call.method.streaming:
            self._admission.close_stream(call.peer)
