"""The ring of the configuration that a robot gets: it has the video, and costs no viewer anything."""

from pathlib import Path

import pytest

from common.config import load
from preview.config import PreviewSettings
from recorder.config import RecorderSettings

SHIPPED = Path(__file__).parents[2] / "docker/config"


def test_the_ring_has_the_video_of_the_time_before(monkeypatch: pytest.MonkeyPatch) -> None:
    # As compose.yaml and the systemd unit do.
    monkeypatch.setenv("RECORDER__VIDEO__SOCKET", "/run/robot-video/tap.sock")
    settings = load(RecorderSettings, SHIPPED / "recorder.yaml")
    assert settings.ring.preset
    assert settings.records_video(settings.ring.preset)


def test_the_recorder_of_a_ring_holds_no_bit_rate_above_the_floor_of_the_profile() -> None:
    """The defect: with the profile `record` a viewer over 1 Mbit/s had old pictures at all times."""
    settings = load(PreviewSettings, SHIPPED / "preview.yaml")
    floors = [each.floor_kbps for each in settings.profiles.targets.values()]
    assert settings.video_tap.floor_kbps <= min(floors)
