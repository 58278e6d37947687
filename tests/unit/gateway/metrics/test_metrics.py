"""What is counted, and how it is shown."""

import asyncio
import json
import re
import time
from collections.abc import AsyncGenerator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families

from common.histogram import Histogram
from gateway.links.bridge.requests import Outcome
from gateway.metrics.bridge import BridgeMetrics
from gateway.metrics.collector import GatewayCollector
from gateway.metrics.loop_delay import LoopDelay
from gateway.metrics.recorder import RecorderMetrics
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.connections.packet_filter import ConnectPolicy
from gateway.rpc.interceptors.stats import MethodStats, Stats
from gateway.rpc.responses.status_stream import StatusStream
from gateway.status.board import Board
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.pictures import Pictures
from gateway.status.preview import (
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    PreviewView,
    Profile,
    Stream,
)
from gateway.status.snapshot import (
    Identity,
    Noted,
    Programs,
    Rules,
    Runtime,
    Setup,
    Snapshot,
    SourceRule,
    take,
)
from gateway.status.sources import ODOMETRY, VISION, SourceSpec, number_source, text_source
from gateway.status.values import Number, Received, Text, Velocity
from tests.support.cloud_views import uploading_view
from tests.support.drive_views import stopped_view
from tests.support.eventually import eventually
from tests.support.recorder_views import recording_view

ROOT = Path(__file__).parents[4]
NOW_S = 1000.0
PREVIEW = PreviewView(
    state=PreviewState.RUNNING,
    profile=Profile.BALANCED,
    last_error="",
    service_reachable=True,
    listener=Listener(7100, 125, "127.0.0.1"),
    stream=Stream(1280, 720, 30.0, 2500, Codec.H265, False, ""),
    encoder=Encoder("x264", False, "mpp-h265", "no such element"),
    measured=Received(Measurement(29.5, 2400.0, 2, 12, 180.0, 6.0), NOW_S - 0.5),
    counters=Counters(4, 3, 2, 1),
)
FAULT = Condition("odometry.stale", Severity.ERROR, "odometry", "it stopped", "look at it")


def snapshot(preview: PreviewView = PREVIEW) -> Snapshot:
    """Odometry 0.25 s old, vision never seen."""
    setup = Setup(
        Identity('lab "7"', "1.2.3", insecure=False),
        Rules({ODOMETRY: SourceRule(1000, True), VISION: SourceRule(2000, True)}, 3000),
    )
    board = Board({ODOMETRY: Received(Velocity(0.3, 0.4, -0.5), NOW_S - 0.25)})
    programs = Programs(preview, stopped_view(NOW_S), recording_view(NOW_S), uploading_view(NOW_S))
    noted = Noted(
        faults=(Fault(FAULT, 1.0, 2.0, None, 1), Fault(FAULT, 1.0, 2.0, 3.0, 1)),
        gateway=Runtime("abc", "boot", 61_500, 3, 10, 1),
        pictures=Pictures(2, 140, 138, direct_count=1, srt_latency_count=1, most_given_up=4),
    )
    return take(setup, board, programs, NOW_S, noted)


class World:
    """The state of one instant, and streams that have left something out."""

    skipped = 7
    gaps = 1
    failures = 3
    open = 12
    closed = 34
    throttled = 35
    muted = 36
    policy = ConnectPolicy(frozenset({"10.0.0.1", "10.0.0.2"}), one_in=8)
    expired = 37
    sent_bytes = 38
    waiting = 39
    dropped = 40
    answered = dict.fromkeys(Outcome, 41)

    def __init__(self, now: Snapshot) -> None:
        self._now = now

    def snapshot(self) -> Snapshot:
        return self._now


def families(calls: Stats, now: Snapshot | None = None) -> list[Metric]:
    """As Prometheus understands the text."""
    world: Any = World(now or snapshot())
    collector = GatewayCollector(
        world,
        stats=calls,
        loop_delay=LoopDelay(),
        connection_guard=world,
        status_stream=world,
        event_stream=world,
        preview_link=world,
        drive_link=world,
        recorder=RecorderMetrics(world, world, world),
        bridge=BridgeMetrics(world, world, world),
    )
    return list(text_string_to_metric_families(collector.text().decode()))


def values(calls: Stats, now: Snapshot | None = None) -> dict[tuple[str, str], float]:
    """By name and labels."""
    return {
        (
            sample.name,
            " ".join(f"{key}={value}" for key, value in sorted(sample.labels.items())),
        ): sample.value
        for family in families(calls, now)
        for sample in family.samples
    }


def some_calls() -> Stats:
    stats = Stats(["GetSystemStatus", "SetPreviewMode", "WatchSystemStatus"])
    status, preview = stats.contract["GetSystemStatus"], stats.contract["SetPreviewMode"]
    for seconds in (0.002, 0.2):
        ended(status, "OK", seconds)
    ended(preview, "INVALID_ARGUMENT", 0.001)
    stats.contract["WatchSystemStatus"].open = 3
    return stats


def ended(stats: MethodStats, code: str, seconds: float) -> None:
    stats.ended[code] += 1
    stats.durations.add(seconds)


def test_a_histogram_counts_what_is_not_longer_than_each_bound() -> None:
    histogram = Histogram((0.1, 1.0))
    for seconds in (0.05, 0.1, 0.5, 7.0):
        histogram.add(seconds)
    assert histogram.cumulative() == [("0.1", 2.0), ("1.0", 3.0), ("+Inf", 4.0)]
    assert histogram.sum_s == pytest.approx(7.65)


def test_calls_are_counted_by_method_and_code() -> None:
    shown = values(some_calls())
    assert shown["robot_gateway_requests_total", "code=OK method=GetSystemStatus"] == 2
    assert shown["robot_gateway_requests_total", "code=INVALID_ARGUMENT method=SetPreviewMode"] == 1
    name = "robot_gateway_request_duration_seconds"
    assert shown[f"{name}_count", "method=GetSystemStatus"] == 2
    assert shown[f"{name}_sum", "method=GetSystemStatus"] == pytest.approx(0.202)
    assert shown[f"{name}_bucket", "le=0.0025 method=GetSystemStatus"] == 1
    assert shown[f"{name}_bucket", "le=+Inf method=GetSystemStatus"] == 2


def test_streams_and_what_slow_readers_did_not_get() -> None:
    shown = values(some_calls())
    assert shown["robot_gateway_streams", "method=WatchSystemStatus"] == 3
    assert shown["robot_gateway_statuses_skipped_total", ""] == 7
    assert shown["robot_gateway_event_gaps_total", ""] == 1
    assert shown["robot_gateway_connections", ""] == 12
    assert shown["robot_gateway_connections_closed_total", ""] == 34
    assert shown["robot_gateway_connections_throttled_total", ""] == 35
    assert shown["robot_gateway_connections_muted_total", ""] == 36
    assert shown["robot_gateway_addresses_blocked", ""] == 2
    assert shown["robot_gateway_strangers_accepted_ratio", ""] == 1 / 8


def test_the_robot_and_its_sources() -> None:
    shown = values(Stats())
    assert shown["robot_gateway_build_info", 'name=lab "7" revision=abc version=1.2.3'] == 1
    assert shown["robot_gateway_uptime_seconds", ""] == 61.5
    assert shown["robot_gateway_clients", ""] == 3
    assert shown["robot_gateway_robot_ready", ""] == 0
    assert shown["robot_gateway_source_age_seconds", "source=odometry"] == 0.25
    assert shown["robot_gateway_source_fresh", "source=odometry"] == 1
    assert shown["robot_gateway_source_fresh", "source=vision"] == 0
    assert ("robot_gateway_source_age_seconds", "source=vision") not in shown
    assert shown["robot_gateway_faults", "severity=error"] == 1
    assert shown["robot_gateway_faults", "severity=info"] == 0


def test_the_values_of_the_configuration_that_can_be_relied_on() -> None:
    fresh, stale, unknown, missing = (
        number_source(label, "", NumberMeaning(unit="°C"))
        for label in ("fresh", "stale", "unknown", "missing")
    )
    gripper, lamp, door = (
        text_source(label, "", TextMeaning((("jammed", Severity.ERROR),)))
        for label in ("gripper", "lamp", "door")
    )
    sources: tuple[SourceSpec[Any], ...] = (fresh, stale, unknown, missing, gripper, lamp, door)
    rules = Rules(dict.fromkeys(sources, SourceRule(1000, False)), 3000)
    now = take(
        Setup(Identity("lab", "1.2.3", insecure=False), rules),
        Board(
            {
                fresh: Received(Number(0.0), NOW_S),
                stale: Received(Number(7.0), NOW_S - 2),
                unknown: Received(Number(None), NOW_S),
                gripper: Received(Text("jammed"), NOW_S),
                lamp: Received(Text("on"), NOW_S),
                door: Received(Text("jammed"), NOW_S - 2),
            }
        ),
        Programs(PREVIEW),
        NOW_S,
    )
    shown = values(Stats(), now)
    numbers = {labels: value for (name, labels), value in shown.items() if name == "robot_gateway_number"}
    assert numbers == {"source=number.fresh unit=°C": 0.0}
    levels = {labels: value for (name, labels), value in shown.items() if name == "robot_gateway_text_level"}
    assert levels == {"source=text.gripper": 2, "source=text.lamp": 0}


def test_the_running_preview() -> None:
    shown = values(Stats())
    states = {state: shown["robot_gateway_preview_state", f"state={state.value}"] for state in PreviewState}
    assert [state for state, value in states.items() if value] == [PreviewState.RUNNING]
    counted = [shown[f"robot_gateway_preview_{n}_total", ""] for n in ("starts", "restarts", "faults")]
    assert counted == [4, 3, 2]
    assert shown["robot_gateway_preview_fallbacks_total", ""] == 1
    assert shown["robot_gateway_preview_link_failures", ""] == 3
    assert shown["robot_gateway_preview_encoder_info", "encoder=x264 hardware=false wanted=mpp-h265"] == 1
    assert shown["robot_gateway_preview_viewers", ""] == 2
    assert shown["robot_gateway_preview_bits_per_second", ""] == 2_400_000
    assert shown["robot_gateway_preview_target_bits_per_second", ""] == 2_500_000
    assert shown["robot_gateway_preview_frame_age_seconds", ""] == 0.012
    assert shown["robot_gateway_preview_worst_rtt_seconds", ""] == 0.18
    assert shown["robot_gateway_preview_worst_loss_percent", ""] == 6
    assert shown["robot_gateway_preview_reporting_viewers", ""] == 2
    assert shown["robot_gateway_preview_picture_age_seconds", ""] == 0.14
    by_delivery = [
        shown["robot_gateway_preview_viewers_by_delivery", f"delivery={each}"]
        for each in ("direct", "srt_latency")
    ]
    assert by_delivery == [1, 1]
    assert shown["robot_gateway_preview_most_packets_given_up", ""] == 4


@pytest.mark.parametrize(
    "measured",
    [None, Received(Measurement(29.5, 2400.0, 2, 12, 180.0, 6.0), NOW_S - 60)],
    ids=["none", "of a minute ago"],
)
def test_figures_without_a_present_measurement_are_left_out(measured: Received[Measurement] | None) -> None:
    shown = values(Stats(), snapshot(replace(PREVIEW, measured=measured)))
    assert ("robot_gateway_preview_viewers", "") not in shown
    assert shown["robot_gateway_preview_starts_total", ""] == 4


def test_a_busy_loop_is_seen() -> None:
    delay = LoopDelay()

    async def seen_s() -> float:
        return delay.delays.sum_s

    async def keep_busy() -> None:
        measuring = asyncio.create_task(delay.run())
        await asyncio.sleep(0)
        time.sleep(0.4)  # noqa: ASYNC251  # a callback that blocks, which is what shall be seen
        await eventually(seen_s, lambda seconds: seconds > 0, "the delay is seen")
        measuring.cancel()

    asyncio.run(asyncio.wait_for(keep_busy(), 10))
    assert delay.delays.sum_s >= 0.1


def test_the_page_names_exactly_the_metrics() -> None:
    shown = {family.name for family in families(some_calls())}
    page = (ROOT / "docs/metrics.md").read_text()
    documented = {
        name.removesuffix("_total") for name in re.findall(r"^\| `(robot_gateway_\w+)", page, re.MULTILINE)
    }
    assert documented == shown


def test_the_dashboard_queries_existing_metrics() -> None:
    dashboard = json.loads((ROOT / "docs/grafana-dashboard.json").read_text())
    queries = [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", ())]
    asked = set(re.findall(r"robot_gateway_\w+", " ".join(queries)))
    assert len(asked) > 10
    assert asked <= {name for name, _ in values(some_calls())}


class MovingWorld:
    def snapshot(self) -> Snapshot:
        return replace(snapshot(), at_s=time.monotonic())


async def test_what_a_slow_reader_does_not_get_is_counted() -> None:
    stream = StatusStream(MovingWorld(), time.monotonic)

    async def skipped() -> int:
        return stream.skipped

    ticking = asyncio.create_task(stream.run())
    responses = stream.responses(0, Recipient("127.0.0.1", sees_passphrase=True))
    assert isinstance(responses, AsyncGenerator)
    await anext(responses)
    assert stream.skipped == 0
    await eventually(skipped, lambda count: count > 0, "the next one came due before the reader was back")
    await responses.aclose()
    ticking.cancel()
