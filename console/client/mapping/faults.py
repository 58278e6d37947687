"""What is wrong, from the contract's messages."""

from console.client.mapping import enums
from console.client.mapping.known import when
from console.client.results import Fault
from omniseer.gateway.v1 import fault_pb2 as wire


def fault(message: wire.Fault) -> Fault:
    """One fault."""
    return Fault(
        id=message.id,
        severity=enums.fault_severity(message.severity),
        component=message.component,
        message=message.message,
        remedy=message.remedy,
        active=message.active,
        age_ms=message.age_ms,
        cleared_age_ms=when(message.HasField("cleared_age_ms"), message.cleared_age_ms),
        times_raised=message.times_raised,
    )
