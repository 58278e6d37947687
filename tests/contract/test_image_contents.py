"""Whatever builds the project from a part of its tree has every package of it."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WHEEL = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
PACKAGES = {re.sub(r"^proto/python/.*", "proto/python", each) for each in WHEEL["packages"]}
DOCKERFILES = [
    path
    for path in (*ROOT.glob("docker/*.Dockerfile"), *ROOT.glob("deploy/**/*.Dockerfile"))
    if "hatchling build" in path.read_text()
]


def test_there_are_images_with_the_project() -> None:
    assert {path.name for path in DOCKERFILES} >= {
        "bridge.Dockerfile",
        "gateway.Dockerfile",
        "hub.Dockerfile",
        "preview.Dockerfile",
    }


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda path: path.name)
def test_an_image_copies_every_package(path: Path) -> None:
    copied = set(re.findall(r"^COPY (\S+) \1$", path.read_text(), re.MULTILINE))
    assert copied >= PACKAGES, f"{path} lacks {PACKAGES - copied}"


@pytest.mark.parametrize("name", [".dockerignore", "docker/systemd-robot", "scripts/install-robot"])
def test_a_list_of_the_tree_has_every_package(name: str) -> None:
    words = set(re.split(r"[\s()!]+", (ROOT / name).read_text()))
    assert words >= PACKAGES, f"{name} lacks {PACKAGES - words}"
