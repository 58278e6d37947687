"""CPU of reading ROS topics: sampling against rclpy callbacks, fast topics against slow ones; and latency.

Publisher and readers are processes of their own, and all figures count the whole reading process. The
references are an ordinary node, whose callbacks convert each message, and the cheapest honest one, whose
callbacks only keep the newest message, which a timer converts as often as our sampler runs. What Fast DDS's
own threads need for each message is part of all figures, and logged.
"""

import statistics

from bench import ros_gateway
from bench.processes import CpuShare, cpu_share, program, resident_mib
from bench.progress import log
from bench.ros_domain import ros_domain
from bench.ros_latency import latencies_ms
from bench.rows import Row

FAST_HZ, SLOW_HZ = 200, 50
ROUNDS = 5
WINDOW_S = 8.0
SETTLE_S = 1.0


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    if not names or {"ros.intake", "ros.intake_newest", "ros.flat"} & set(names):
        rows += _cpu_rows()
    if not names or "ros.gateway_cpu" in names:
        rows.append(_gateway_row())
    if not names or "ros.value_latency_ms" in names:
        rows.append(_latency_row())
    return [row for row in rows if not names or row.name in names]


def _cpu_rows() -> list[Row]:
    ours: list[CpuShare] = []
    stock: list[CpuShare] = []
    newest: list[CpuShare] = []
    slow: list[CpuShare] = []
    for _ in range(ROUNDS):
        with ros_domain():
            with program("bench.ros_talker", str(FAST_HZ)):
                ours.append(_cpu_of("sampler", FAST_HZ))
                stock.append(_cpu_of("callbacks", FAST_HZ))
                newest.append(_cpu_of("newest", FAST_HZ))
            with program("bench.ros_talker", str(SLOW_HZ)):
                slow.append(_cpu_of("sampler", SLOW_HZ))
    return [
        Row(
            name="ros.intake",
            what=f"CPU of reading 4 x {FAST_HZ} Hz odometry, sampled, against rclpy callbacks",
            unit="% of a core",
            values=[each.whole for each in ours],
            references=[each.whole for each in stock],
            bar=0.2,
        ),
        Row(
            name="ros.intake_newest",
            what="the same against rclpy callbacks that keep the newest message, converted 20 times a second",
            unit="% of a core",
            values=[each.whole for each in ours],
            references=[each.whole for each in newest],
            bar=0.35,
        ),
        Row(
            name="ros.flat",
            what=f"CPU of reading 4 x {FAST_HZ} Hz against 4 x {SLOW_HZ} Hz, the whole process",
            unit="% of a core",
            values=[each.whole for each in ours],
            references=[each.whole for each in slow],
            bar=1.6,
        ),
    ]


def _cpu_of(way: str, rate_hz: int) -> CpuShare:
    with program("bench.ros_listener", way) as process:
        cpu_share(process.pid, SETTLE_S)
        cpu = cpu_share(process.pid, WINDOW_S)
        rss = resident_mib(process.pid)
        assert process.stdin
        assert process.stdout
        process.stdin.close()
        kept = int(process.stdout.readline())
    log(
        f"ros: {way} at 4 x {rate_hz} Hz: {cpu.own:.2f} % + {cpu.middleware:.2f} % in Fast DDS, "
        f"{rss:.0f} MiB, {kept} values"
    )
    # A reader that receives nothing needs the least CPU.
    if kept < 4 * 19 * WINDOW_S:
        raise RuntimeError(f"{way} kept {kept} values only: the figures would mean nothing")
    return cpu


def _gateway_row() -> Row:
    with ros_domain():
        percents = ros_gateway.cpu_percents()
    return Row(
        name="ros.gateway_cpu",
        what=(
            f"the whole gateway beside 4 x {ros_gateway.FAST_HZ} Hz, commands, and detections of "
            f"{ros_gateway.BOXES} boxes at {ros_gateway.FRAMES_HZ} Hz"
        ),
        unit="% of a core",
        values=percents,
        bar=12,
    )


def _latency_row() -> Row:
    with ros_domain():
        rounds_ms = latencies_ms()
    found = sorted(one for round_ms in rounds_ms for one in round_ms)
    log(f"ros: {len(found)} values, median {statistics.median(found):.1f} ms, longest {found[-1]:.1f} ms")
    return Row(
        name="ros.value_latency_ms",
        what=f"odometry published until GetSystemStatus shows it: 99th percentile of {len(rounds_ms[0])}",
        unit="ms",
        values=[statistics.quantiles(round_ms, n=100)[98] for round_ms in rounds_ms],
        bar=60.0,
    )
