"""The JSON schema of each program's file: editors complete, check and explain keys and values by it."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import pytest

from common.config import Settings, json_schema, load
from common.errors import UserError
from gateway.config import GatewaySettings
from gateway.config.sources import KINDS
from preview.config import PreviewSettings
from preview.encoders.catalogue import CATALOGUE
from tests.support.program_settings import PROGRAMS, file_with

SOURCE: Final = {"kind": "number", "label": "x", "topic": "/a", "type": "n/msg/O", "field": "a"}


def models(settings_type: type[Settings]) -> Mapping[str, Mapping[str, Any]]:
    """The properties of each section, by the name of its model; the file's own by that of the settings."""
    schema = json.loads(json_schema(settings_type))
    defined = {name: each["properties"] for name, each in schema["$defs"].items() if "properties" in each}
    return {settings_type.__name__: schema["properties"], **defined}


def described(settings_type: type[Settings]) -> Iterator[str]:
    for name, properties in models(settings_type).items():
        yield from (f"{name}.{key}" for key, each in properties.items() if "description" in each)


def accepts(settings_type: type[Settings], values: Any, file: Path) -> bool:
    try:
        load(settings_type, file_with(settings_type, values, file))
    except UserError:
        return False
    return True


@pytest.mark.parametrize("settings_type", PROGRAMS)
def test_keys_are_explained(settings_type: type[Settings]) -> None:
    """With the text that the program's source has of them."""
    sockets = [each["socket"] for each in models(settings_type).values() if "socket" in each]
    assert sockets
    assert all(each.get("description") for each in sockets)
    assert len(list(described(settings_type))) > 2


def test_an_explanation_is_whole() -> None:
    sources = models(GatewaySettings)["SourceSettings"]
    assert sources["stale_after_ms"]["description"] == (
        "Age from which the value is too old to rely on; the default depends on the kind."
    )


def test_words_of_which_there_are_few_are_listed() -> None:
    assert models(GatewaySettings)["SourceSettings"]["kind"]["enum"] == list(KINDS)
    assert models(PreviewSettings)["EncoderSettings"]["order"]["items"]["enum"] == list(CATALOGUE)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        (
            "topic",
            ("/a", "a", "~/a", "/a/b_1", "a/B", "my odom", "/", "", "~a", "/a/", "/a//b", "/1", "a" * 248),
        ),
        (
            "type",
            ("n/msg/O", "nav_msgs/msg/Odometry", "Odometry", "n/srv/O", "n/msg/", "n/msg/O ", "1/msg/O"),
        ),
        ("field", ("a", "a.b", "cells[2].voltage", "a[-1]", "a..b", "_x", "a.", "ä", "", "a" * 201)),
    ],
)
def test_a_text_fits_the_schema_of_a_source_if_the_gateway_takes_it(
    tmp_path: Path, key: str, values: tuple[str, ...]
) -> None:
    schema = models(GatewaySettings)["SourceSettings"][key]
    of_text = next(each for each in schema.get("anyOf", [schema]) if each["type"] == "string")
    taken = 0
    for value in values:
        fits = bool(re.search(of_text["pattern"], value)) and len(value) <= of_text.get(
            "maxLength", len(value)
        )
        assert fits == accepts(GatewaySettings, {"sources": [{**SOURCE, key: value}]}, tmp_path / "x.yaml"), (
            value
        )
        taken += fits
    assert 0 < taken < len(values)


def test_a_topic_fits_the_schema_of_a_camera_if_the_preview_takes_it(tmp_path: Path) -> None:
    pattern = models(PreviewSettings)["RosSource"]["topic"]["pattern"]
    for topic in ("/front/image_raw", "/a", "image_raw", "~/image", "/", "/arm/", "/arm image", "/1"):
        accepted = accepts(PreviewSettings, {"source": {"kind": "ros", "topic": topic}}, tmp_path / "x.yaml")
        assert bool(re.search(pattern, topic)) == accepted, topic
