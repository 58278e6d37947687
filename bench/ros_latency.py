"""Latency of a value: odometry is published, and a client polls the gateway until it has the value."""

import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import grpc
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.free import free_tcp_port

ROUNDS = 5
COUNT = 200
TOPIC = "/odometry/filtered"
GIVE_UP_S = 10.0
ASK_EVERY_S = 0.002
PAUSE_S = 0.1
"""Messages leave at random moments of this span, so that they meet the sampler at any phase."""


def latencies_ms() -> list[list[float]]:
    """Returns the time from `publish` until GetSystemStatus has the value: ROUNDS of COUNT messages."""
    dice = random.Random(1)
    with _gateway() as gateway, _publisher() as publisher:
        _wait_for_discovery(gateway, publisher)
        rounds: list[list[float]] = []
        for number in range(ROUNDS * COUNT):
            if number % COUNT == 0:
                rounds.append([])
            time.sleep(dice.uniform(0, PAUSE_S))
            rounds[-1].append(_publish_until_seen(gateway, publisher, float(number + 1)))
    return rounds


def _publish_until_seen(gateway: Any, publisher: Any, speed: float) -> float:
    message = Odometry()
    message.twist.twist.linear.x = speed
    sent_s = time.monotonic()
    publisher.publish(message)
    while time.monotonic() - sent_s < GIVE_UP_S:
        if gateway.GetSystemStatus(GetSystemStatusRequest()).health.measured_vx_mps == speed:
            return 1000 * (time.monotonic() - sent_s)
        time.sleep(ASK_EVERY_S)
    raise RuntimeError(f"message {speed:.0f} was not seen within {GIVE_UP_S:.0f} s")


def _wait_for_discovery(gateway: Any, publisher: Any) -> None:
    """Publishes until the first value arrives: DDS discovery has finished."""
    deadline = time.monotonic() + GIVE_UP_S
    while not gateway.GetSystemStatus(GetSystemStatusRequest()).health.odom_available:
        if time.monotonic() > deadline:
            raise RuntimeError("the gateway never saw a message")
        publisher.publish(Odometry())
        time.sleep(0.1)


@contextmanager
def _gateway() -> Iterator[Any]:
    """Runs the program with its default settings, and yields a client of it."""
    port = free_tcp_port()
    with tempfile.TemporaryDirectory() as directory:
        settings = {
            "GATEWAY__GRPC__PORT": str(port),
            "GATEWAY__PREVIEW__SOCKET": str(Path(directory) / "preview.sock"),
            "GATEWAY__LOG_LEVEL": "error",
        }
        command = [str(Path(sys.executable).parent / "robot-gateway"), "serve"]
        with subprocess.Popen(command, env=os.environ | settings) as process:
            try:
                with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
                    grpc.channel_ready_future(channel).result(timeout=GIVE_UP_S)
                    yield RobotGatewayStub(channel)
            finally:
                process.terminate()


@contextmanager
def _publisher() -> Iterator[Any]:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_latency", context=context, enable_rosout=False)
    try:
        yield node.create_publisher(Odometry, TOPIC, QoSProfile(depth=10))
    finally:
        node.destroy_node()
        context.shutdown()
        context.destroy()
