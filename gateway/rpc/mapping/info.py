"""The gateway process as messages of the contract."""

from collections.abc import Mapping

from gateway.rpc.interceptors.stats import MethodStats
from gateway.status.snapshot import Runtime, Snapshot
from omniseer.gateway.v1 import gateway_info_pb2 as pb
from omniseer.gateway.v1.robot_gateway_pb2 import GetGatewayInfoResponse


def gateway_facts(runtime: Runtime) -> pb.GatewayFacts:
    """Returns the part that every status carries."""
    return pb.GatewayFacts(
        revision=runtime.revision,
        boot_id=runtime.boot_id,
        uptime_ms=runtime.uptime_ms,
        client_count=runtime.client_count,
        requests_served=runtime.requests_served,
        requests_refused=runtime.requests_refused,
        run_id=runtime.run_id,
    )


def gateway_info(
    snapshot: Snapshot, methods: Mapping[str, MethodStats], wall_clock_unix_ms: int, configuration_json: str
) -> GetGatewayInfoResponse:
    """Returns everything about the gateway process."""
    return GetGatewayInfoResponse(
        gateway_name=snapshot.identity.name,
        gateway_version=snapshot.identity.version,
        gateway=gateway_facts(snapshot.gateway),
        wall_clock_unix_ms=wall_clock_unix_ms,
        methods=[
            pb.MethodCounts(method=method, served=counts.served, refused=counts.refused, failed=counts.failed)
            for method, counts in sorted(methods.items())
        ],
        configuration_json=configuration_json,
    )
