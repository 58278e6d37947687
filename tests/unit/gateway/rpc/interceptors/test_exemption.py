"""Whose stops no limit applies to."""

from dataclasses import dataclass

import pytest

from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import CONTRACT, TELEOP, Method
from gateway.rpc.interceptors.exemption import Exemption
from tests.support.calls import call_of


@dataclass(frozen=True)
class Callers:
    """All are known, or none is."""

    known: bool

    def knows(self, _call: CallContext) -> bool:
        return self.known


@pytest.mark.parametrize("known", [True, False])
def test_a_stop_is_exempt_where_its_caller_is_known(known: bool) -> None:
    stop = call_of("StopRobot", service=TELEOP.full_name)
    Exemption(Callers(known)).on_call(stop)
    assert stop.unlimited is known


def test_only_the_stop_may_be() -> None:
    exemption = Exemption(Callers(known=True))
    methods = [f"/{each.full_name}/{name}" for each in (CONTRACT, TELEOP) for name in each.methods_by_name]
    exempt = [path for path in methods if exemption.applies_to(Method(path))]
    assert exempt == [f"/{TELEOP.full_name}/StopRobot"]
