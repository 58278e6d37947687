"""Limits of each caller: requests a second, open calls and streams, over all of its connections."""

from collections.abc import Awaitable

from common.errors import TooMuchError
from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method, Open
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.caller_shares import CallerShares
from gateway.rpc.connections.refusal_delay import RefusalDelay


class CallerLimit(Interceptor[CallContext]):
    """Refuses calls beyond a caller's share with a delay. Further in than `Auth`, which knows who calls.

    A stop is never refused, and takes nothing of the share.

    Args:
        shares: the account of callers.
        admission: gets to know connections whose refusals are too many to be delayed.
        refusals: delays refusals.
    """

    def __init__(self, shares: CallerShares, admission: Admission, refusals: RefusalDelay) -> None:
        self._shares = shares
        self._admission = admission
        self._refusals = refusals

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is for callers who are known, and not the stop."""
        return method.needed is not Open.PUBLIC and not method.unlimited

    def on_call(self, call: CallContext) -> Awaitable[None] | None:
        """Takes a token, and a place among the caller's open calls or streams.

        Raises:
            TooMuchError: there is none left; from the awaitable, after a delay.
        """
        if not _is_limited(call):
            return None
        caller = call.caller
        try:
            self._shares.take_token(caller)
            if call.method.streaming:
                self._shares.open_stream(caller)
            else:
                self._shares.open_call(caller)
        except TooMuchError as error:
            if self._refusals.full:
                self._admission.note_excess(call.peer)
            return self._refusals.refuse(error, call.waited_s)
        return None

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Gives the place back."""
        if not _is_limited(call):
            return
        if call.method.streaming:
            self._shares.close_stream(call.caller)
        else:
            self._shares.close_call(call.caller)


def _is_limited(call: CallContext) -> bool:
    """Returns whether the caller has a name or an address; at a Unix socket it may have neither."""
    return call.principal is not None or call.peer.ip is not None
