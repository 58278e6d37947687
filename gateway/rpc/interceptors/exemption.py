"""Which calls no limit applies to: stops, where the robot knows their caller."""

from typing import Protocol

from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method


class Callers(Protocol):
    """Knows who calls."""

    def knows(self, call: CallContext) -> bool:
        """Returns whether the caller shows a valid credential; cheap."""


class Exemption(Interceptor[CallContext]):
    """Holds stops of callers without a valid credential to the limits of all other calls.

    A stop that is refused costs as much as any other refusal: exempt by the method's name alone, it would be
    the way around every brake for strangers. A credential that was added a moment ago is not known yet: its
    stop takes a turn, and waits for none unless the same connection has shown wrong credentials.

    Args:
        callers: asked at each stop.
    """

    def __init__(self, callers: Callers) -> None:
        self._callers = callers

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is the stop."""
        return method.unlimited

    def on_call(self, call: CallContext) -> None:
        """Ends the exemption of an unknown caller."""
        call.unlimited = self._callers.knows(call)
