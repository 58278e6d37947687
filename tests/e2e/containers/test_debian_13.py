"""Debian 13, with its Python 3.13 and GStreamer 1.26, in a container without network (docker/debian-13)."""

import json
import subprocess
from pathlib import Path

import pytest

from tests.support.engine import ROOT
from tests.support.release import VERSION, release, released_repository

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(3000)]

IMAGE = "robot-gateway-debian-13"
WITHIN_S = 2400
FRAMES = 30
# The demo is this tree's, robotctl what install-console has installed.
WATCH = f"""
set -e
export HOME=/tmp
scripts/install-console --release /release >&2
scripts/demo > /tmp/demo 2>&1 &
timeout 120 sh -c 'until /tmp/.local/bin/robotctl status > /dev/null 2>&1; do sleep 1; done' ||
  {{ cat /tmp/demo >&2; exit 1; }}
/tmp/.local/bin/robotctl --version
/tmp/.local/bin/robotctl preview on >&2
/tmp/.local/bin/robotctl view --headless --frames {FRAMES} --json
"""


@pytest.fixture(scope="module", autouse=True)
def image() -> None:
    """Builds it, or has it from the build cache."""
    found = subprocess.run(
        ["docker", "image", "inspect", "debian:trixie-slim"], capture_output=True, timeout=30, check=False
    )
    if found.returncode != 0:
        pytest.skip("there is no image debian:trixie-slim. Type: docker/base-image.sh trixie")
    built = in_debian_13("true")
    assert built.returncode == 0, built.stderr[-3000:]


def in_debian_13(*command: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [ROOT / "docker/debian-13", *command],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=WITHIN_S,
        check=False,
    )


@pytest.mark.parametrize(
    "words",
    [("--short",), ("tests/integration/console/viewer",), ("tests/integration/preview/test_service.py",)],
    ids=lambda words: words[0],
)
def test_the_tests_pass_there(words: tuple[str, ...]) -> None:
    """Those of the first line end with the demo's main job, `scripts/demo --check`."""
    ended = in_debian_13("scripts/test", *words)
    assert ended.returncode == 0, ended.stdout[-5000:] + ended.stderr[-3000:]


def test_an_installed_console_shows_the_video_there(tmp_path: Path) -> None:
    made = tmp_path / "made"
    ended = release(released_repository(tmp_path / "repository"), "--without-images", "--output", made)
    assert ended.returncode == 0, ended.stderr
    watched = subprocess.run(
        ["docker", "run", "--rm", "--init", "--network=none", "--volume", f"{made}:/release:ro", IMAGE,
         "sh", "-c", WATCH],
        capture_output=True, text=True, timeout=WITHIN_S, check=False,
    )  # fmt: skip
    assert watched.returncode == 0, watched.stderr[-3000:]
    version, _, report = watched.stdout.partition("\n")
    assert version.startswith(f"robotctl {VERSION}")
    assert json.loads(report)["pictures"] >= FRAMES
