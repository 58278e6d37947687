"""docs/configuration.md names every key there is, and none that is not."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from bridge.config import BridgeSettings
from drive.config import DriveSettings
from gateway.config import GatewaySettings
from preview.config import PreviewSettings
from recorder.config import RecorderSettings
from tap.config import TapSettings

PAGE = (Path(__file__).parents[2] / "docs/configuration.md").read_text(encoding="utf-8")
PROFILE = re.compile(r"^profiles\.(low-bw|balanced|high-quality)\.")


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_in(part)


def keys_of(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in model.model_fields.items():
        inner = list(models_in(field.annotation))
        listed = "[]" if str(field.annotation).startswith("tuple[") and inner else ""
        if listed or not inner:
            yield f"{prefix}{name}"
        for part in inner:
            named = ".NAME" if "Mapping[str" in str(field.annotation) else listed
            yield from keys_of(part, f"{prefix}{field.alias or name}{named}.")


@pytest.mark.parametrize(
    ("settings", "heading"),
    [
        (GatewaySettings, "## Gateway"),
        (PreviewSettings, "## Preview service"),
        (DriveSettings, "## Drive program"),
        (RecorderSettings, "## Recorder"),
        (BridgeSettings, "## Bridge"),
        (TapSettings, "## Camera tap"),
    ],
)
def test_the_page_lists_exactly_the_keys(settings: type[BaseModel], heading: str) -> None:
    chapter = PAGE.split(heading + "\n")[1].split("\n## ")[0]
    documented = set(re.findall(r"^\| `([^`]+)` \|", chapter, re.MULTILINE))
    keys = {PROFILE.sub("profiles.NAME.", key) for key in keys_of(settings)}
    # Each of the preview's cameras has the keys of its source.
    assert documented == {key.replace("cameras.", "source.") for key in keys}
