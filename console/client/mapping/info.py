"""The gateway program itself, from the contract's messages."""

from console.client.mapping.known import when
from console.client.results import GatewayFacts, GatewayInfo, MethodCounts
from omniseer.gateway.v1 import gateway_info_pb2 as wire
from omniseer.gateway.v1 import robot_gateway_pb2


def gateway_facts(message: wire.GatewayFacts, *, told: bool) -> GatewayFacts:
    """What comes with every status.

    Args:
        message: the facts.
        told: whether the gateway sent them at all.
    """
    return GatewayFacts(
        revision=message.revision or None,
        boot_id=message.boot_id or None,
        uptime_ms=when(told, message.uptime_ms),
        client_count=when(told, message.client_count),
        requests_served=when(told, message.requests_served),
        requests_refused=when(told, message.requests_refused),
        run_id=message.run_id or None,
    )


def gateway_info(message: robot_gateway_pb2.GetGatewayInfoResponse) -> GatewayInfo:
    """Everything about the gateway program."""
    return GatewayInfo(
        gateway_name=message.gateway_name,
        gateway_version=message.gateway_version,
        gateway=gateway_facts(message.gateway, told=message.HasField("gateway")),
        wall_clock_unix_ms=message.wall_clock_unix_ms,
        methods=tuple(
            MethodCounts(
                method=counts.method, served=counts.served, refused=counts.refused, failed=counts.failed
            )
            for counts in message.methods
        ),
        configuration_json=message.configuration_json,
    )
