"""Faults as messages of the contract."""

from gateway.rpc.mapping.enums import SEVERITIES
from gateway.status.fault import Fault
from gateway.status.freshness import age_ms
from omniseer.gateway.v1 import fault_pb2 as pb


def fill_fault(message: pb.Fault, fault: Fault, now_s: float) -> None:
    """Writes one fault, with its ages at `now_s`, to an empty message."""
    condition = fault.condition
    message.id = condition.fault_id
    message.severity = SEVERITIES[condition.severity]
    message.component = condition.component
    message.message = condition.message
    message.remedy = condition.remedy
    message.active = fault.active
    message.age_ms = age_ms(fault.onset_s, now_s)
    if fault.cleared_s is not None:
        message.cleared_age_ms = age_ms(fault.cleared_s, now_s)
    message.times_raised = fault.times_raised
