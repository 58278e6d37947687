"""The program itself: health, doctor, metrics, clients that are none, and its end."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.request import urlopen

import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import Image
from std_msgs.msg import Header as Marker

from common.camera_tap import (
    MAX_PACKET_BYTES,
    READY,
    STATUS_REQUEST,
    Header,
    Kind,
    decode,
    encode_watch,
)
from preview.pipeline.tap_client import TapClient, TapError, topic_problem
from tap.app import MAX_CONNECTIONS
from tap.image import READERS
from tests.support.free import free_tcp_port
from tests.support.ros_camera import compressed, picture, ros_camera
from tests.support.running_tap import PATIENCE_S, RunningTap
from tests.support.talker import talking
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[3]
TOPIC = "/front/image_raw"


def run(directory: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """A command of the program, with the configuration of the tap that runs."""
    environment = os.environ | {"ROBOT_TAP_CONFIG": str(directory / "tap.yaml")}
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@contextmanager
def connected(tap: RunningTap) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
        client.settimeout(10)
        client.connect(str(tap.socket))
        yield client


def ends(client: socket.socket) -> bool:
    """Whether the tap closes the connection."""
    try:
        return client.recv(10_000) == b""
    except ConnectionError:
        return True


def received(client: socket.socket) -> Header:
    """What the next frame is; its memory is given back."""
    for _ in range(10):  # A problem, and its end, may come first.
        packet, memory, _, _ = socket.recv_fds(client, MAX_PACKET_BYTES, 1)
        header, _ = decode(packet)
        for each in memory:
            os.close(each)
        if header.kind is Kind.FRAME:
            return header
    pytest.fail("no frame has come")


def has_room(tap: RunningTap) -> bool:
    """Whether the tap answers a new connection."""
    with suppress(ConnectionError), connected(tap) as client:
        client.send(STATUS_REQUEST)
        return client.recv(100_000) != b""
    return False


def test_it_is_healthy_while_it_serves(tap: RunningTap, tmp_path: Path) -> None:
    healthy = run(tmp_path, "tap.health")
    assert (healthy.returncode, healthy.stdout) == (0, f"{tap.socket}: 0 cameras wanted\n")
    tap.process.send_signal(signal.SIGSTOP)
    frozen = run(tmp_path, "tap.health")
    assert frozen.returncode == 1
    assert "does not respond" in frozen.stderr
    tap.process.send_signal(signal.SIGCONT)
    tap.kill()
    dead = run(tmp_path, "tap.health")
    assert dead.returncode == 1
    assert "Start it: robot-tap serve" in dead.stderr


@pytest.mark.timed
def test_the_doctor_looks_at_every_image_topic(tap: RunningTap, tmp_path: Path) -> None:
    depth = picture()
    depth.encoding = "32FC1"
    unstamped = picture(width=64, height=48)
    with (
        ros_camera("/good"),
        ros_camera("/old", unstamped, age_s=None),
        ros_camera("/depth", depth),
        ros_camera("/none", compressed(b"GIF89a", "gif")),
        ros_camera("/silent", hz=0.01) as silent,
    ):
        wait_until(lambda: silent.published == 1, "its only message")
        found = run(tmp_path, "tap.cli", "doctor", "--json")
    assert found.returncode == 1, found.stderr
    findings = {each["check"]: each for each in json.loads(found.stdout)["findings"]}
    assert findings["config"]["verdict"] == findings["tap"]["verdict"] == "good"
    assert findings["topic./good"]["verdict"] == "good"
    assert findings["topic./good"]["what"] == "/good: 320x240 pixels, RGB"
    assert findings["topic./old"]["verdict"] == "note"
    assert "stamp" in findings["topic./old"]["what"]
    assert findings["topic./depth"]["verdict"] == "wrong"
    assert "'32FC1'" in findings["topic./depth"]["what"]
    assert "neither a JPEG nor a PNG" in findings["topic./none"]["what"]
    assert "no message in 2 s" in findings["topic./silent"]["what"]
    assert tap.process.poll() is None


def test_the_doctor_says_what_to_start(ros_domain: int, tmp_path: Path) -> None:  # noqa: ARG001
    found = run(tmp_path, "tap.cli", "doctor", "--json")
    assert found.returncode == 1, "its configuration does not exist"
    (tmp_path / "tap.yaml").write_text(f"socket: {tmp_path}/tap.sock", encoding="utf-8")
    found = run(tmp_path, "tap.cli", "doctor", "--json")
    assert found.returncode == 0, found.stderr
    findings = {each["check"]: each for each in json.loads(found.stdout)["findings"]}
    assert findings["tap"]["remedy"] == "Start it: robot-tap serve"
    assert findings["topics"]["what"] == "the graph has no image topics"


def test_its_counts_are_metrics(ros_domain: int, tmp_path: Path) -> None:  # noqa: ARG001
    port = free_tcp_port()
    depth = picture()
    depth.encoding = "32FC1"
    with RunningTap(tmp_path, metrics={"port": port}) as tap, ros_camera(TOPIC) as published:
        client = TapClient(tap.socket, TOPIC)
        try:
            for _ in range(5):
                frame = wait_until(lambda: client.receive(1), "a frame")
                os.close(frame.memory)
            published.shows = depth
            tap.wait_for(lambda state: state["topics"][TOPIC]["refused"]["encoding"] > 0, "a refusal")
        finally:
            client.close()
        with urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as page:  # its own
            lines = page.read().decode().splitlines()
    values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    assert float(values[f'robot_tap_frames_total{{topic="{TOPIC}"}}']) >= 5
    assert float(values[f'robot_tap_refused_total{{reason="encoding",topic="{TOPIC}"}}']) > 0
    assert float(values[f'robot_tap_refused_total{{reason="data",topic="{TOPIC}"}}']) == 0


@pytest.mark.parametrize(
    "packets",
    [[b"nonsense"], [b"{}"], [encode_watch("/a b")], [b"x" * 2000], [encode_watch(TOPIC), b"more"], [b""]],
    ids=lambda packets: str(packets[-1][:10]),
)
def test_what_is_no_client_is_disconnected(tap: RunningTap, packets: list[bytes]) -> None:
    with connected(tap) as client:
        for packet in packets:
            client.send(packet)
        wait_until(lambda: ends(client), "disconnected")
    # The thread of the connection closes it first, and ends then.
    tap.wait_for(lambda state: state["wanted"] == [], "nothing is wanted")


def test_it_says_whether_a_topic_is_published_as_images(tap: RunningTap) -> None:
    """Without a subscription."""
    with talking() as talker:
        talker.publisher("/words", Marker)

        def answer(topic: str) -> str | None:
            return topic_problem(tap.socket, topic, time.monotonic() + PATIENCE_S)

        def says(topic: str, problem: str) -> None:
            wait_until(lambda: answer(topic) == problem, f"{topic}: {problem}", PATIENCE_S)

        says("/nothing", "nothing publishes /nothing")
        says("/words", f"/words is published as std_msgs/msg/Header, not as {' or '.join(READERS)}")
        with ros_camera(TOPIC):
            says(TOPIC, "")
            assert tap.state()["wanted"] == []
            assert tap.state()["topics"] == {}
        says(TOPIC, f"nothing publishes {TOPIC}")


def test_a_client_that_says_nothing_is_disconnected_in_time(tap: RunningTap) -> None:
    with connected(tap) as client:
        assert ends(client)


def test_a_client_that_permits_nothing_gets_nothing_and_costs_nothing(tap: RunningTap) -> None:
    with ros_camera(TOPIC) as published, connected(tap) as client:
        client.send(encode_watch(TOPIC))
        wait_until(lambda: published.subscribers == 1, "subscribed")
        before = published.published
        wait_until(lambda: published.published > before + 60, "many pictures later")
        assert tap.state()["topics"][TOPIC]["frames"] == 0
        for _ in range(50):
            client.send(READY)
        tap.wait_for(lambda state: state["topics"][TOPIC]["frames"] >= 1, "a frame")
        assert tap.state()["topics"][TOPIC]["frames"] <= 2, "permits do not add up"


def test_a_reader_that_was_slow_gets_the_newest_picture(tap: RunningTap) -> None:
    """Those that it missed are gone: a picture's width is its number, times ten."""
    with talking() as talker, connected(tap) as client:
        publisher = talker.publisher(TOPIC, Image)
        client.send(encode_watch(TOPIC))
        wait_until(lambda: publisher.get_subscription_count() == 1, "subscribed")
        for newest in (5, 10):
            for number in range(newest - 4, newest + 1):
                publisher.publish(picture(width=10 * number, height=8))
            assert publisher.wait_for_all_acked(Duration(seconds=10)), "all have reached the tap"
            client.send(READY)
            assert received(client).width == 10 * newest
        # A frame is counted after it was sent.
        tap.wait_for(lambda state: state["topics"][TOPIC]["frames"] >= 2, "both are counted")
        assert tap.state()["topics"][TOPIC]["frames"] == 2


def test_there_is_room_for_so_many_connections(tap: RunningTap) -> None:
    clients = [socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(MAX_CONNECTIONS + 1)]
    try:
        for client in clients:
            client.settimeout(10)
            client.connect(str(tap.socket))
            with suppress(ConnectionError):  # It is refused already.
                client.send(encode_watch(TOPIC))
        assert wait_until(lambda: ends(clients[-1]), "the last one is refused")
    finally:
        for client in clients:
            client.close()
    wait_until(lambda: "refused a connection" in tap.log.read_text(encoding="utf-8"), "it is logged")
    wait_until(lambda: has_room(tap), "there is room again")


@pytest.mark.timed
def test_no_more_frames_than_configured_are_taken(ros_domain: int, tmp_path: Path) -> None:  # noqa: ARG001
    small = picture(width=32, height=24)  # So that it is the rate that counts, and not what UDP carries.
    with RunningTap(tmp_path, max_fps=10) as tap, ros_camera(TOPIC, small, hz=100) as published:
        client = TapClient(tap.socket, TOPIC)
        try:
            os.close(wait_until(lambda: client.receive(1), "the first frame").memory)
            before, frames, begun_s = published.published, 0, time.monotonic()
            while published.published < before + 200:
                if frame := client.receive(1):
                    os.close(frame.memory)
                    frames += 1
            took_s = time.monotonic() - begun_s
        finally:
            client.close()
    # Two seconds, and those that publisher, tap or client stood still with the machine.
    assert 5 <= frames <= 10 * took_s + 2


def to_the_end(client: TapClient) -> None:
    """Takes the frames that are on their way."""
    while frame := client.receive(1):
        os.close(frame.memory)


def test_it_ends_at_once_with_cameras_connected(ros_domain: int, tmp_path: Path) -> None:  # noqa: ARG001
    with RunningTap(tmp_path) as tap, ros_camera(TOPIC):
        client = TapClient(tap.socket, TOPIC)
        try:
            os.close(wait_until(lambda: client.receive(1), "a frame").memory)
            tap.process.terminate()
            assert tap.process.wait(10) == 0
            assert not tap.socket.exists()
            with pytest.raises(TapError, match="closed the connection"):
                to_the_end(client)
        finally:
            client.close()
        tap.start_again()


def test_a_second_one_at_the_same_socket_is_refused(tap: RunningTap, tmp_path: Path) -> None:
    second = run(tmp_path, "tap.cli", "serve")
    assert second.returncode == 1
    assert f"socket {tap.socket} is served by another program" in second.stderr
    assert tap.state()
