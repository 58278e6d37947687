"""A machine without GStreamer and Qt: everything but video works, and one line says what to install."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import ENDS_WITHIN_S, environment, only_line

ROOT = Path(__file__).parents[3]
BARE = """
import sys
from tests.support.light_imports import pytest_configure
pytest_configure()
from console.cli import main
main()
"""
STRANGERS = (
    "rclpy",
    "gi",
    "PySide6",
    "common.gst",
    "gateway",
    "preview",
    "typer",
    "rich",
    "console.receiver",
)


def on_a_bare_machine(*words: str) -> "subprocess.CompletedProcess[str]":
    return run(BARE, *words)


def run(code: str, *words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(),
        check=False,
    )


@pytest.mark.parametrize(
    "words",
    [
        ("status",),
        ("watch", "--count", "1"),
        ("overlay",),
        ("info",),
        ("doctor",),
        ("preview", "on"),
        ("preview", "off"),
        ("robots",),
        ("--help",),
    ],
    ids=" ".join,
)
def test_everything_but_video_works(words: tuple[str, ...]) -> None:
    double = GatewayDouble()
    with serving(double) as port:
        ended = on_a_bare_machine("--target", f"127.0.0.1:{port}", *words)
    # The double makes no stream; that the doctor says so is not what is asked here.
    assert ended.returncode == 0 or words == ("doctor",), ended.stderr
    assert ended.stdout
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("view",), ("GStreamer", "apt-get install", "python3-gi", "gstreamer1.0-plugins-bad")),
        (("view", "--headless"), ("GStreamer", "apt-get install", "python3-gi")),
        (("monitor",), ("Qt", "scripts/install-console")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_video_says_in_one_line_what_to_install(words: tuple[str, ...], names: tuple[str, ...]) -> None:
    with serving(GatewayDouble()) as port:
        ended = on_a_bare_machine(*words, "--target", f"127.0.0.1:{port}")
    assert (ended.returncode, ended.stdout) == (1, "")
    line = only_line(ended.stderr)
    assert line.startswith("error: ")
    assert "Type" in line
    for name in names:
        assert name in line


def test_the_client_library_knows_neither_ros_nor_gstreamer_nor_terminals() -> None:
    ran = run("import json, sys, console.client; print(json.dumps(sorted(sys.modules)))")
    loaded = json.loads(ran.stdout)
    assert "grpc" in loaded, "the list is of what is loaded"
    assert not [
        name for name in loaded if name.startswith(tuple(f"{one}." for one in STRANGERS)) or name in STRANGERS
    ]
