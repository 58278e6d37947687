"""Presets, and what is refused."""

from pathlib import Path

import pytest

from common.config import load
from common.errors import UserError
from gateway.config.sources import DEFAULT_SOURCES
from recorder.config import PresetSettings, RecorderSettings


def loaded(tmp_path: Path, text: str) -> RecorderSettings:
    file = tmp_path / "recorder.yaml"
    file.write_text(text, encoding="utf-8")
    return load(RecorderSettings, file)


@pytest.mark.parametrize(
    ("topic", "selected"),
    [
        ("/odom", True),
        ("/camera/image", True),
        ("/camera/image/compressed", True),
        ("/camera/debug/image", False),
        ("/odom2", False),
        ("/ODOM", False),
    ],
)
def test_a_preset_selects_by_pattern(topic: str, selected: bool) -> None:
    preset = PresetSettings(topics=("/odom", "/camera/*"), exclude=("/camera/debug/*",))
    assert preset.selects(topic) is selected


def test_the_defaults(tmp_path: Path) -> None:
    settings = loaded(tmp_path, "")
    assert settings.first_preset == "driving"
    assert settings.presets["everything"].selects("/anything/at/all")
    assert not settings.presets["driving"].selects("/camera/image_raw")
    assert settings.presets["driving"].selects("/tf_static")
    assert settings.ring.preset is None
    assert not settings.records_video("driving"), "there is no tap"


def test_driving_has_what_the_gateway_shows_by_default_but_what_the_robot_sees(tmp_path: Path) -> None:
    """The defect: it had no battery, whose topic was another one there."""
    driving = loaded(tmp_path, "").presets["driving"]
    left_out = {each.kind for each in DEFAULT_SOURCES if not driving.selects(each.topic)}
    assert left_out == {"vision", "detections"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("presets: {}", "presets"),
        ("presets: {'a b': {topics: ['*']}}", "can't be a preset's name"),
        ("presets: {a: {topics: []}}", "topics"),
        ("presets: {a: {topics: ['odom']}}", "odom"),
        ("presets: {a: {topics: ['[!x]']}}", "topics"),
        ("ring: {preset: flying}", "is not a preset"),
        ("ring: {seconds: 1}", "seconds"),
        ("incidents: {min_severity: fatal}", "min_severity"),
        ("nonsense: 1", "nonsense"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(UserError, match=complaint):
        loaded(tmp_path, text)
