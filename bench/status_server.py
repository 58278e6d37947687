"""The server that bench.status measures: the whole gateway with everything filled, and an empty method.

As a program it prints its port and serves until standard input closes; it does not use ROS. There are no rate
limits unless the argument "limited" is given. "guarded" and a directory of credentials enable TLS and
authentication.
"""

import asyncio
import itertools
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Final

import grpc
import uvloop

from common.garbage import freeze_objects
from common.interceptors import RpcContext
from gateway.app import running
from gateway.assembly import Gateway, build
from gateway.config import (
    DEFAULT_SOURCES,
    GatewaySettings,
    GrpcSettings,
    LimitSettings,
    SecuritySettings,
    SourceSettings,
)
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.reconciler import Desired
from gateway.status.board import Board
from gateway.status.event import Event, ModeChanged
from gateway.status.fault import Severity
from gateway.status.preview import (
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)
from gateway.status.sources import (
    BATTERY,
    COMPUTE,
    DIAGNOSTICS,
    EFFECTIVE_COMMAND,
    MODE,
    MUX_INPUTS,
    NETWORK,
    ODOMETRY,
    ONBOARD_BATTERY,
    VISION,
)
from gateway.status.values import (
    Battery,
    CommandSource,
    Compute,
    DiagnosticItem,
    DiagnosticLevel,
    Diagnostics,
    Mode,
    Network,
    Received,
    Velocity,
    Vision,
)

EMPTY_METHOD = "/bench.Reference/Empty"
CONSTANT_METHOD = "/bench.Reference/Constant"
RAISE_METHOD = "/bench.Reference/Raise"
CONSTANT_EVERY_S = 0.1
_UNLIMITED: Final = LimitSettings(
    requests_per_s=1e9, burst=1_000_000_000, caller_requests_per_s=1e9, connections_per_caller=1000
)
"""The rate limiter runs and refuses no call."""
_MODE: Final = SourceSettings(kind="mode", topic="/mode", type="std_msgs/msg/String", stale_after_ms=1000)
_FIVE_FAULTS: Final = Diagnostics(
    tuple(
        DiagnosticItem(f"lidar {number}", DiagnosticLevel.ERROR if number < 5 else DiagnosticLevel.OK, "")
        for number in range(20)
    )
)
_UPDATE_EVERY_S: Final = 0.05
"""The gateway reads its sources 20 times a second."""


def main() -> None:
    words = sys.argv[1:]
    guarded = words[words.index("guarded") + 1] if "guarded" in words else None
    uvloop.run(_serve("limited" not in words, Path(guarded) if guarded else None))


async def _serve(unlimited: bool, credentials: Path | None) -> None:
    settings = GatewaySettings(
        grpc=GrpcSettings(port=0),
        security=SecuritySettings(credentials=credentials),
        limits=_UNLIMITED if unlimited else LimitSettings(),
        sources=(*DEFAULT_SOURCES, _MODE),
    )
    gateway = build(settings, _BenchRobot())
    for number in range(8):
        gateway.events.note(_event(f"odometry received, for the {number}th time"))
    async with running(gateway, extra=[_reference(gateway)]) as port:
        # As the program does (gateway/app.py).
        freeze_objects()
        print(port, flush=True)
        await asyncio.to_thread(sys.stdin.read)


class _BenchRobot:
    """Outside of the gateway: a robot whose values change all the time."""

    @contextmanager
    def feeding(self, board: Board) -> Iterator[None]:
        task = asyncio.create_task(_drive(board), name="robot")
        try:
            yield
        finally:
            task.cancel()

    def preview_connector(self) -> "_PreviewInMemory":
        return _PreviewInMemory()


class _PreviewInMemory:
    """A preview service in this process: always RUNNING, reports as often as the sources do."""

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["_PreviewInMemory"]:
        yield self

    async def reports(self) -> AsyncIterator[PreviewReport]:
        while True:
            yield _RUNNING
            await asyncio.sleep(_UPDATE_EVERY_S)

    async def apply(self, _desired: Desired[PreviewSpec]) -> PreviewReport:
        return _RUNNING

    async def request_key_frame(self, _newest_pts: int | None) -> bool:
        return True

    async def report_picture_age(self, _age_ms: int) -> None: ...


def _reference(gateway: Gateway) -> grpc.GenericRpcHandler:
    """Returns the reference methods: they do nothing but answer."""

    async def raise_event(_request: bytes, _context: RpcContext) -> bytes:
        gateway.events.note(_event("an event"))
        return b""

    return grpc.method_handlers_generic_handler(
        "bench.Reference",
        {
            "Empty": grpc.unary_unary_rpc_method_handler(_empty),
            "Constant": grpc.unary_stream_rpc_method_handler(_constant),
            "Raise": grpc.unary_unary_rpc_method_handler(raise_event),
        },
    )


def _event(words: str) -> Event:
    return Event(Severity.INFO, "mission", words, ModeChanged(words), words)


async def _empty(_request: bytes, _context: RpcContext) -> bytes:
    return b""


async def _constant(request: bytes, _context: RpcContext) -> AsyncIterator[bytes]:
    """Streams the request back ten times a second."""
    while True:
        yield request
        await asyncio.sleep(CONSTANT_EVERY_S)


async def _drive(board: Board) -> None:
    for number in itertools.count():
        now = time.monotonic()
        speed_mps = 0.5 + number % 100 / 1000
        board[ODOMETRY] = Received(Velocity(vx_mps=speed_mps, vy_mps=-0.02, wz_rad_s=0.1), now)
        board[MODE] = Received(Mode("exploring"), now)
        command = Received(Velocity(0.5, 0.0, 0.1), now)
        board[EFFECTIVE_COMMAND] = board[MUX_INPUTS[CommandSource.KEYBOARD]] = command
        board[DIAGNOSTICS] = Received(_FIVE_FAULTS, now)
        board[VISION] = Received(Vision(29.9, 29.7, 11.5, 3, 1), now)
        battery = Received(Battery(present=True, voltage_v=15.1, charge_percent=81.0, charging=False), now)
        board[BATTERY] = board[ONBOARD_BATTERY] = battery
        board[COMPUTE] = Received(Compute(41.0, 61.5, False, 2_000_000_000, 8_000_000_000, 47.0), now)
        board[NETWORK] = Received(
            Network("wlan0", connected=True, wifi_signal_dbm=-61, link_quality_percent=70), now
        )
        await asyncio.sleep(_UPDATE_EVERY_S)


_RUNNING = PreviewReport(
    instance_id="bench",
    applied_revision=1,
    state=PreviewState.RUNNING,
    profile=Profile.BALANCED,
    last_error="",
    listener=Listener(port=7100, latency_ms=125, address="127.0.0.1"),
    stream=Stream(1280, 720, 30.0, 2500, Codec.H265, False, "RTT 180 ms, 6 % loss: 2500 -> 1200 kbit/s"),
    encoder=Encoder("x264", hardware=False, wanted="mpp-h265", fallback_reason="no such element"),
    measurement=Measurement(29.9, 1210.0, 2, 12, 180.0, 6.0),
    counters=Counters(starts=3, restarts=1, faults=1, fallbacks=1),
)


if __name__ == "__main__":
    main()
