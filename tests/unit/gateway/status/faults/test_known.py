"""The list of faults that a gateway can have is whole, and rules that match none of them are found."""

import re
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.config import GatewaySettings, load_settings, without_effect
from gateway.status import faults
from gateway.status.faults.known import known_faults, matches
from gateway.status.sources import SOURCES

FAULTS = Path(faults.__file__).parent


def test_every_id_in_the_rules_is_known() -> None:
    known = set(known_faults(SOURCES))
    written = {
        found[1]
        for file in FAULTS.glob("*.py")
        if file.name != "known.py"
        for found in re.finditer(r'"([a-z_]+\.[a-z_]+)"', file.read_text(encoding="utf-8"))
    }
    assert len(written) > 20
    assert written - known == set()


@pytest.mark.parametrize(
    ("rule", "fault_id", "matched"),
    [
        ("preview", "preview.unreachable", True),
        ("preview.unreachable", "preview.unreachable", True),
        ("preview.un", "preview.unreachable", False),
        ("diagnostics.lidar", "diagnostics.*", True),
        ("diagnostics.lidar.front", "diagnostics.*", False),
        ("preview.camera.front", "preview.camera.*", True),
    ],
)
def test_a_rule_matches_whole_words(rule: str, fault_id: str, *, matched: bool) -> None:
    assert matches(rule, fault_id) is matched


GENERIC = """
sources:
- {kind: number, topic: /a, type: n/msg/O, label: heat, field: a}
- {kind: text, topic: /b, type: n/msg/O, label: arm, field: a}
faults: {ignored_by_health: [RULE]}
"""


def loaded(tmp_path: Path, rule: str) -> GatewaySettings:
    file = tmp_path / "gateway.yaml"
    file.write_text(GENERIC.replace("RULE", rule), encoding="utf-8")
    return load_settings(file)


@pytest.mark.parametrize(
    "rule", ["preview", "cloud.upload", "number", "number.heat", "number.heat.high", "text.arm.value.jammed"]
)
def test_a_rule_that_can_match_is_passed_over_in_silence(tmp_path: Path, rule: str) -> None:
    assert list(without_effect(loaded(tmp_path, rule))) == []


@pytest.mark.parametrize(
    ("rule", "meant"),
    [
        ("lidar", ""),
        ("number.cold", ""),
        ("number.heat.hihg", "number.heat.high"),
        ("diagnostics.lidar", ""),
        ("battery.low", ""),
        ("preview.unreachabel", "preview.unreachable"),
        ("cloud.upload.x", "cloud.upload"),
    ],
)
def test_a_rule_that_matches_nothing_is_named(tmp_path: Path, rule: str, meant: str) -> None:
    (sentence,) = without_effect(loaded(tmp_path, rule))
    assert f"has no effect for '{rule}'" in sentence
    assert meant in sentence


def test_the_defaults_have_an_effect() -> None:
    assert list(without_effect(load_settings(None))) == []


def test_tiles_beyond_those_that_windows_show_are_named(tmp_path: Path) -> None:
    file = tmp_path / "gateway.yaml"
    tile = "{{kind: number, topic: /a, type: n/msg/O, label: n{}, field: a, tile: true}}"
    file.write_text("sources:\n" + "".join(f"- {tile.format(n)}\n" for n in range(8)), encoding="utf-8")
    sentences = list(without_effect(load_settings(file)))
    assert [sentence.split("'")[1] for sentence in sentences] == ["number.n6", "number.n7"]
    assert all("windows show the first 6 tiles alone" in sentence for sentence in sentences)


def test_a_rule_that_can_be_no_id_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError):
        loaded(tmp_path, "Lidar*")
