"""The windows on screens from 1024x600 to 4K.

Each screenshot is an artefact in artifacts/monitor or artifacts/view, named by its situation and the screen.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.support.qt import KEPT_IN

pytestmark = [pytest.mark.gst, pytest.mark.timeout(180)]

ROOT = Path(__file__).parents[4]
ENDS_WITHIN_S = 150


def shot(situation: str, width: int, height: int, scale: int) -> Mapping[str, Any]:
    """Takes a screenshot in a process of its own; returns what the window reports of itself."""
    folder = KEPT_IN.with_name("view") if situation.startswith("view") else KEPT_IN
    file = folder / f"{situation}-{width}x{height}.png"
    file.unlink(missing_ok=True)
    command = [sys.executable, "-m", "tests.support.window_shots", situation]
    command += [str(width), str(height), str(scale), str(file)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=ENDS_WITHIN_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert file.exists()
    found: Mapping[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize(
    ("situation", "width", "height", "scale", "share"),
    [
        ("trouble", 1024, 600, 1, 0.47),
        ("driving", 1280, 800, 1, 0.50),
        ("recording", 1024, 600, 1, 0.47),
        ("tiles", 1024, 600, 1, 0.47),
        ("tiles-driving", 1280, 800, 1, 0.50),
        ("tiles-driving", 3840, 2160, 2, 0.65),
        ("panel-closed", 1280, 800, 1, 0.80),
        ("cockpit", 1920, 1080, 1, 0.65),
        ("cockpit", 3840, 2160, 2, 0.65),
    ],
)
def test_the_cockpit_fills_the_screen(
    situation: str, width: int, height: int, scale: int, share: float
) -> None:
    found = shot(situation, width, height, scale)
    assert found["maximised"], "the first time"
    assert found["pixels"] == [width, height]
    assert found["window"] == found["screen"] == [width // scale, height // scale]
    assert found["picture_share"] >= share


@pytest.mark.parametrize(
    ("width", "height", "share"),
    [pytest.param(1024, 600, 0.85, id="smaller than a frame"), pytest.param(1280, 800, 0.92, id="larger")],
)
def test_the_view_fits_its_screen(width: int, height: int, share: float) -> None:
    found = shot("view", width, height, 1)
    assert not found["maximised"]
    assert found["pixels"] == found["window"]
    assert found["window"][0] <= width
    assert found["window"][1] <= height
    assert found["least"][0] <= 640, "it can be made smaller, too"
    assert found["picture_share"] >= share


@pytest.mark.parametrize(("width", "height", "scale"), [(1920, 1080, 1), (3840, 2160, 2)])
def test_the_view_fills_a_large_screen(width: int, height: int, scale: int) -> None:
    found = shot("view-maximised", width, height, scale)
    assert found["maximised"]
    assert found["pixels"] == [width, height]
    assert found["window"] == found["screen"] == [width // scale, height // scale]
    assert found["picture_share"] >= 0.92
