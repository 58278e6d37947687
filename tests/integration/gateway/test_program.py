"""`robot-gateway` as people start it: one line for what they can mend, exit codes, a quick end."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.free import free_tcp_port
from tests.support.waiting import wait_until

MAIN = "from gateway.cli import main; main()"
# As on a machine where ROS was never installed.
WITHOUT_ROS = f"import sys; sys.modules['rclpy'] = None; {MAIN}"


def gateway(*arguments: str, program: str = MAIN) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "gateway.yaml"
    path.write_text(
        f"grpc: {{port: {free_tcp_port()}}}\npreview: {{socket: {tmp_path / 'preview.sock'}}}\nsources: []\n"
    )
    return path


def only_line(text: str) -> str:
    lines = text.splitlines()
    assert len(lines) == 1, text
    return lines[0]


def test_check_says_what_it_found_good(config: Path) -> None:
    done = gateway("check", "--config", str(config))
    assert done.returncode == 0
    assert "configuration good" in only_line(done.stdout)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("grcp: {port: 1}", "unknown key 'grcp'"),
        ("grpc: {host: 0.0.0.0}", "security: {insecure: true}"),
        (f"sources: []\ngrpc: {{port: 0, socket: /{'x' * 107}}}", "a path of at most 107 bytes"),
        ("sources: []\ngrpc: {port: 0, host: '[::1]'}", "a host name or an address, 127.0.0.1 or ::1"),
        (f"sources: []\nmetrics: {{port: 0, host: {'a' * 64}, insecure: true}}", "a host name or an address"),
    ],
)
def test_a_wrong_configuration_ends_with_one_line_and_2(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    done = gateway("check", "--config", str(path))
    assert done.returncode == 2
    assert words in only_line(done.stderr)


def test_serve_ends_with_the_same_line_and_2(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("grpc: {host: 0.0.0.0}")
    checked, served = (gateway(command, "--config", str(path)) for command in ("check", "serve"))
    assert (served.returncode, only_line(served.stderr)) == (2, only_line(checked.stderr))


def test_a_missing_configuration_is_named(tmp_path: Path) -> None:
    done = gateway("serve", "--config", str(tmp_path / "none.yaml"))
    assert done.returncode == 2
    assert "none.yaml can't be read" in only_line(done.stderr)


def test_without_ros_a_gateway_with_sources_says_what_to_install(tmp_path: Path) -> None:
    path = tmp_path / "gateway.yaml"
    path.write_text(f"grpc: {{port: {free_tcp_port()}}}\nlog_level: error\n")
    done = gateway("serve", "--config", str(path), program=WITHOUT_ROS)
    assert done.returncode == 1
    assert "rclpy" in only_line(done.stderr)
    assert "scripts/setup" in done.stderr


@pytest.mark.timed
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_quickly_and_well(config: Path, tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "log"
    with (
        log.open("w") as errors,
        subprocess.Popen(
            [sys.executable, "-c", WITHOUT_ROS, "serve", "--config", str(config)], stderr=errors
        ) as process,
    ):
        try:
            wait_until(lambda: "serving operators" in log.read_text(), "the gateway serves")
            signalled_s = time.monotonic()
            os.kill(process.pid, number)
            assert process.wait(10) == 0
            assert time.monotonic() - signalled_s < 3
        finally:
            process.kill()
    assert "Traceback" not in log.read_text()


def test_a_taken_port_ends_with_one_line_and_1(config: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    command = [sys.executable, "-c", MAIN, "serve", "--config", str(config)]
    with log.open("w") as errors, subprocess.Popen(command, stderr=errors) as first:
        try:
            wait_until(lambda: "serving operators" in log.read_text(), "the first gateway serves")
            config.write_text(config.read_text() + "log_level: error\n")
            second = gateway("serve", "--config", str(config))
        finally:
            first.terminate()
    assert second.returncode == 1
    assert "is taken by another program" in only_line(second.stderr)


def test_no_collection_looks_at_what_lives_as_long_as_the_program(config: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    counts = "import atexit, gc; atexit.register(lambda: print(gc.get_freeze_count(), len(gc.get_objects())))"
    command = [sys.executable, "-c", f"{counts}; {WITHOUT_ROS}", "serve", "--config", str(config)]
    with (
        log.open("w") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            wait_until(lambda: "serving operators" in log.read_text(), "the gateway serves")
            process.terminate()
            written, _ = process.communicate(timeout=10)
        finally:
            process.kill()
    kept, others = map(int, written.split())
    assert kept > others
