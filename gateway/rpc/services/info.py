"""The gateway program itself: version, configuration, statistics, clocks."""

import time
from typing import Final

from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.mapping.info import gateway_info
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetGatewayInfoRequest,
    GetGatewayInfoResponse,
    PingRequest,
    PingResponse,
)

_NS_PER_MS: Final = 1_000_000


class InfoService:
    """Facts about the gateway.

    Args:
        state: identity and run.
        stats: of the calls.
        configuration_json: as operators may see it.
    """

    def __init__(self, state: SnapshotSource, stats: Stats, configuration_json: str) -> None:
        self._state = state
        # It can't change while this process lives.
        self._boot_id = state.snapshot().gateway.boot_id
        self._stats = stats
        self._configuration_json = configuration_json

    async def get_gateway_info(
        self, _request: GetGatewayInfoRequest, _call: CallContext
    ) -> GetGatewayInfoResponse:
        """Returns the facts, and the calendar clock of this instant."""
        return gateway_info(
            self._state.snapshot(),
            self._stats.contract,
            time.time_ns() // _NS_PER_MS,
            self._configuration_json,
        )

    async def ping(self, _request: PingRequest, _call: CallContext) -> PingResponse:
        """Returns both clocks, read as close together as Python can."""
        monotonic_ns, wall_clock_unix_ns = time.monotonic_ns(), time.time_ns()
        return PingResponse(
            monotonic_ns=monotonic_ns,
            wall_clock_unix_ns=wall_clock_unix_ns,
            boot_id=self._boot_id,
        )
