"""Faults as messages of the contract."""

from gateway.rpc.mapping.enums import SEVERITIES
from gateway.status.fault import Fault
from omniseer.gateway.v1 import fault_pb2 as pb


def fault_message(fault: Fault, now_s: float) -> pb.Fault:
    """Returns one fault with its ages at `now_s`."""
    condition = fault.condition
    return pb.Fault(
        id=condition.fault_id,
        severity=SEVERITIES[condition.severity],
        component=condition.component,
        message=condition.message,
        remedy=condition.remedy,
        active=fault.active,
        age_ms=_age_ms(fault.onset_s, now_s),
        cleared_age_ms=None if fault.cleared_s is None else _age_ms(fault.cleared_s, now_s),
        times_raised=fault.times_raised,
    )


def _age_ms(at_s: float, now_s: float) -> int:
    return max(0, int((now_s - at_s) * 1000))
