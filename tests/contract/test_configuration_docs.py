"""docs/configuration.md names every key there is, and no other; its examples of cameras are accepted."""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel
from typer.testing import CliRunner

from bridge.config import BridgeSettings
from drive.config import DriveSettings
from gateway.config import GatewaySettings
from preview.cli import app as preview_app
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


def examples_of_cameras() -> list[str]:
    """The page's examples of cameras, as files."""
    blocks = re.findall(r"^ *```yaml\n(.*?)^ *```", PAGE, re.MULTILINE | re.DOTALL)
    found = [
        block for each in blocks if re.search(r"^cameras:", block := textwrap.dedent(each), re.MULTILINE)
    ]
    assert len(found) == len(re.findall(r"^ *cameras:$", PAGE, re.MULTILINE)), "each is in a block"
    assert len(found) >= 2
    return found


@pytest.mark.parametrize("example", examples_of_cameras())
def test_the_examples_of_cameras_are_accepted_and_printed_as_they_are(example: str, tmp_path: Path) -> None:
    file, printed = tmp_path / "preview.yaml", tmp_path / "printed.yaml"
    file.write_text(example, encoding="utf-8")
    checked = CliRunner().invoke(preview_app, ["check", "--config", str(file)])
    assert (checked.exit_code, checked.output) == (0, f"{file}: ok\n"), checked.exception

    def print_of(path: Path) -> str:
        return CliRunner().invoke(preview_app, ["check", "--config", str(path), "--print"]).output

    printed.write_text(print_of(file), encoding="utf-8")
    assert "cameras:" in printed.read_text(encoding="utf-8")
    assert print_of(printed) == printed.read_text(encoding="utf-8")
