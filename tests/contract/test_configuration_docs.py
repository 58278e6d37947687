"""docs/configuration.md names every key there is, and no other; the programs take the documents' examples."""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from pydantic import BaseModel
from typer.testing import CliRunner

from bridge.config import BridgeSettings
from common.config import load
from common.errors import UserError
from drive.config import DriveSettings
from gateway.config import GatewaySettings
from hub.receiver.config import ReceiverSettings
from preview.cli import app as preview_app
from preview.config import PreviewSettings
from recorder.config import RecorderSettings
from tap.config import TapSettings
from tests.support.program_settings import PROGRAMS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/configuration.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FOREIGN = {"twist_mux", "collision_monitor", "services"}
"""First keys of files that are not of this project's programs: of ROS nodes, and of compose."""
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


def test_the_schema_is_named_as_an_editor_finds_it() -> None:
    """The YAML language server takes a path that is not absolute from the file's folder, `~` included."""
    written = re.findall(r"check --schema > (\S+)", PAGE)
    named = re.findall(r"# yaml-language-server: \$schema=(\S+)", PAGE)
    assert written == named == ["gateway.schema.json"]


def test_the_page_of_uploads_lists_exactly_the_keys_of_the_receiver() -> None:
    page = (ROOT / "docs/uploads.md").read_text(encoding="utf-8")
    table = page.partition("| key | default | meaning |\n|---|---|---|\n")[2].partition("\n\n")[0]
    documented = [key for row in table.splitlines() for key in re.findall(r"`([^`]+)`", row.split("|")[1])]
    assert sorted(documented) == sorted(keys_of(ReceiverSettings))


def files() -> Iterator[Any]:
    """Each block of YAML of the documents that a program of this project reads."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for block in re.findall(r"^ *```yaml\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL):
            example = textwrap.dedent(block)
            first = next(iter(yaml.safe_load(example)))
            if first not in FOREIGN:
                yield pytest.param(example, id=f"{page.name}-{first}")


def refusals(file: Path, keys: set[str]) -> list[str]:
    """What each program that knows the keys says of a file; empty where one of them takes it."""
    said = []
    for settings in PROGRAMS:
        if keys <= settings.model_fields.keys():
            try:
                load(settings, file)
            except UserError as error:
                said.append(str(error))
            else:
                return []
    return said or [f"no program has all of {sorted(keys)}"]


@pytest.mark.parametrize("example", list(files()))
def test_a_program_takes_the_example(example: str, tmp_path: Path) -> None:
    file = tmp_path / "example.yaml"
    file.write_text(example, encoding="utf-8")
    assert refusals(file, set(yaml.safe_load(example))) == []


def test_an_example_that_no_program_takes_is_noticed(tmp_path: Path) -> None:
    file = tmp_path / "example.yaml"
    for wrong in ("rings: {preset: a}", "ring: {presets: a}", "grpc: {host: 0.0.0.0}"):
        file.write_text(wrong, encoding="utf-8")
        assert refusals(file, set(yaml.safe_load(wrong)))


def paths_of(value: Any, prefix: str = "") -> Iterator[str]:
    """The keys of a value, as docs/configuration.md writes them."""
    if not isinstance(value, dict):
        yield prefix.removesuffix(".")
        return
    for key, inner in value.items():
        yield from paths_of(inner, f"{prefix}{key}.")


def sections() -> Iterator[Any]:
    """Each section of a configuration that is named within the text, `grpc: {host: 0.0.0.0}` for example."""
    for page in PAGES:
        # Of a camera within `cameras`, whose names are the user's, and of compose.
        for span in sorted(set(re.findall(r"`([a-z_]+: ?\{[^`\n]*\})`", page.read_text(encoding="utf-8")))):
            if not span.startswith(("front:", "services:")):
                yield pytest.param(span, id=f"{page.name}-{span}")


@pytest.mark.parametrize("section", list(sections()))
def test_a_program_has_the_keys_of_a_section_in_the_text(section: str) -> None:
    named = set(paths_of(yaml.safe_load(section)))
    assert any(named <= set(keys_of(settings)) for settings in PROGRAMS), named


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
