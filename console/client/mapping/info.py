"""The gateway program itself, from the contract's messages."""

from console.client.mapping.values import when
from console.client.results import GatewayFacts, GatewayInfo, MethodCounts
from omniseer.gateway.v1 import gateway_info_pb2 as wire
from omniseer.gateway.v1 import robot_gateway_pb2


def gateway_facts(message: wire.GatewayFacts, *, reported: bool) -> GatewayFacts:
    """Returns the gateway's facts in a status.

    Args:
        message: The facts.
        reported: Whether the gateway sent them; an older one does not.
    """
    return GatewayFacts(
        revision=message.revision or None,
        boot_id=message.boot_id or None,
        uptime_ms=when(reported, message.uptime_ms),
        client_count=when(reported, message.client_count),
        requests_served=when(reported, message.requests_served),
        requests_refused=when(reported, message.requests_refused),
        run_id=message.run_id or None,
    )


def gateway_info(message: robot_gateway_pb2.GetGatewayInfoResponse) -> GatewayInfo:
    """Returns build, call counts and configuration of the gateway program."""
    return GatewayInfo(
        gateway_name=message.gateway_name,
        gateway_version=message.gateway_version,
        gateway=gateway_facts(message.gateway, reported=message.HasField("gateway")),
        wall_clock_unix_ms=message.wall_clock_unix_ms,
        methods=tuple(
            MethodCounts(
                method=counts.method, served=counts.served, refused=counts.refused, failed=counts.failed
            )
            for counts in message.methods
        ),
        configuration_json=message.configuration_json,
    )
