"""The server that bench.status measures: the gateway's own stack with everything filled, and an empty method.

Run as a program it prints its port, serves until its standard input ends and uses no ROS. Callers may ask as
often as they like, unless the word "limited" follows. After "guarded" comes the directory of the credentials
that callers need.
"""

import asyncio
import itertools
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import grpc
import uvloop

from common.bind import bind_tcp
from common.rpc import Context, new_server
from gateway.config import SecuritySettings
from gateway.door import Door
from gateway.preview_link.actual import Actual
from gateway.preview_link.control import PreviewControl
from gateway.preview_link.link import PreviewLink
from gateway.preview_link.reconciler import Reconciler
from gateway.rpc.answers import Answers
from gateway.rpc.caller import Callers
from gateway.rpc.controls import Controls
from gateway.rpc.counting import CountingInterceptor
from gateway.rpc.limiting import LimitInterceptor
from gateway.rpc.limits import Admission, Limits
from gateway.rpc.server import SERVICE, method_handlers
from gateway.rpc.servicer import RobotGateway, Streams
from gateway.rpc.staying import Staying
from gateway.rpc.subscribing import EventStreams
from gateway.rpc.tally import Tally
from gateway.rpc.watching import StatusWatch
from gateway.status.board import Board
from gateway.status.event import ModeChanged, News
from gateway.status.events import EventLog
from gateway.status.fault import Condition, Fault, Severity
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
from gateway.status.runtime import Runtime
from gateway.status.snapshot import Identity, Rules, Snapshot, SourceRule, take
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
    ROS_SOURCES,
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
    Odometry,
    Received,
    Velocity,
    Vision,
)

EMPTY_METHOD = "/bench.Reference/Empty"
CONSTANT_METHOD = "/bench.Reference/Constant"
RAISE_METHOD = "/bench.Reference/Raise"
CONSTANT_EVERY_S = 0.1
_UNLIMITED = Limits(requests_per_s=1e9, burst=1_000_000_000)
"""The same code runs; nobody is refused."""
_TOO_HOT = Condition("platform.temperature", Severity.WARNING, "computer", "it is too hot", "let it cool")
FAULTS = (Fault(_TOO_HOT, onset_s=0.0, seen_s=1.0, cleared_s=None, times_raised=1),) * 5
_ALL_WELL = Diagnostics((DiagnosticItem("lidar", DiagnosticLevel.OK, ""),) * 20)
_NEWS_EVERY_S = 0.05
"""The gateway reads its sources 20 times a second."""


def main() -> None:
    words = sys.argv[1:]
    guarded = words[words.index("guarded") + 1] if "guarded" in words else None
    uvloop.run(_serve("limited" not in words, Path(guarded) if guarded else None))


async def _serve(unlimited: bool, credentials: Path | None) -> None:
    board, events = Board(), EventLog("bench")
    reconciler, tally = Reconciler(1), Tally()
    link = PreviewLink(Path("/nonexistent"), reconciler)
    for number in range(8):
        events.add(_mode(f"odometry received, for the {number}th time"), time.monotonic())

    def snapshot() -> Snapshot:
        return take(
            identity=Identity("bench", "0.0.0", insecure=False),
            rules=_RULES,
            board=board,
            preview=link.view,
            events=events.newest(),
            faults=FAULTS,
            gateway=Runtime("a" * 40, "b" * 36, 1, tally.client_count(), tally.served, tally.refused),
            now_s=time.monotonic(),
        )

    streams = Streams(StatusWatch(snapshot, time.monotonic), EventStreams(events), Staying(lambda _: None))
    gateway = RobotGateway(
        snapshot,
        Answers(snapshot, lambda: link.view, time.monotonic),
        PreviewControl(link, 1.0),
        Callers(None),
        streams,
        tally=tally,
        controls=Controls(lambda _: None),
        configuration_json="{}",
    )

    async def raise_event(_request: bytes, _context: Context) -> bytes:
        events.add(_mode("an event"), time.monotonic())
        return b""

    door = Door(SecuritySettings(credentials=credentials), lambda _news: None, lambda: None)
    guards = [door.guard] if door.guard else []
    handlers = method_handlers(gateway)
    counting = CountingInterceptor(gateway.tally, SERVICE, handlers)
    limiting = LimitInterceptor(Admission(_UNLIMITED if unlimited else Limits()))
    server = new_server([counting, limiting, *guards])
    server.add_generic_rpc_handlers(
        (
            grpc.method_handlers_generic_handler(SERVICE, handlers),
            grpc.method_handlers_generic_handler(
                "bench.Reference",
                {
                    "Empty": grpc.unary_unary_rpc_method_handler(_empty),
                    "Constant": grpc.unary_stream_rpc_method_handler(_constant),
                    "Raise": grpc.unary_unary_rpc_method_handler(raise_event),
                },
            ),
        )
    )
    port = bind_tcp(server, "127.0.0.1", 0, door.credentials())
    await server.start()
    background = [
        asyncio.create_task(_bring_news(board, reconciler)),
        asyncio.create_task(streams.watch.run()),
    ]
    print(port, flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in background:
        task.cancel()
    await server.stop(None)


def _mode(words: str) -> News:
    return News(Severity.INFO, "mission", words, ModeChanged(words), words)


async def _empty(_request: bytes, _context: Context) -> bytes:
    return b""


async def _constant(request: bytes, _context: Context) -> AsyncIterator[bytes]:
    """The request again, ten times a second."""
    while True:
        yield request
        await asyncio.sleep(CONSTANT_EVERY_S)


async def _bring_news(board: Board, reconciler: Reconciler) -> None:
    for number in itertools.count():
        now = time.monotonic()
        # A robot that moves: something changes all the time.
        speed_mps = 0.5 + number % 100 / 1000
        board[ODOMETRY] = Received(Odometry(vx_mps=speed_mps, vy_mps=-0.02, wz_rad_s=0.1), now)
        board[MODE] = Received(Mode("exploring"), now)
        command = Received(Velocity(0.5, 0.0, 0.1), now)
        board[EFFECTIVE_COMMAND] = board[MUX_INPUTS[CommandSource.KEYBOARD]] = command
        board[DIAGNOSTICS] = Received(_ALL_WELL, now)
        board[VISION] = Received(Vision(29.9, 29.7, 11.5, 3, 1), now)
        battery = Received(Battery(present=True, voltage_v=15.1, charge_percent=81.0, charging=False), now)
        board[BATTERY] = board[ONBOARD_BATTERY] = battery
        board[COMPUTE] = Received(Compute(41.0, 61.5, False, 2_000_000_000, 8_000_000_000, 47.0), now)
        board[NETWORK] = Received(
            Network("wlan0", connected=True, wifi_signal_dbm=-61, link_quality_percent=70), now
        )
        reconciler.heard(_RUNNING, now)
        await asyncio.sleep(_NEWS_EVERY_S)


_RULE = SourceRule(1000, required=True)
_RULES = Rules(dict.fromkeys(ROS_SOURCES, _RULE), 3000)
_RUNNING = Actual(
    instance_id="bench",
    applied_revision=1,
    state=PreviewState.RUNNING,
    profile=Profile.BALANCED,
    last_error="",
    listener=Listener(port=7100, latency_ms=125),
    stream=Stream(1280, 720, 30.0, 2500, Codec.H265, False, "RTT 180 ms, 6 % loss: 2500 -> 1200 kbit/s"),
    encoder=Encoder("x264", hardware=False, wanted="mpp-h265", fallback_reason="no such element"),
    measurement=Measurement(29.9, 1210.0, 2, 12, 180.0, 6.0),
    counters=Counters(starts=3, restarts=1, faults=1, fallbacks=1),
)


if __name__ == "__main__":
    main()
