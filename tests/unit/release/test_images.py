"""The images of a release, by a stand-in for scripts/images."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from release_program.images import PLATFORMS, build, save

from tests.support.engine import ROOT

STAND_IN = """#!/bin/sh
echo "$TAG${SOURCE_DATE_EPOCH:+ of $SOURCE_DATE_EPOCH}: $*" >> "$(dirname "$0")/calls"
case "$1" in
  ids) echo "robot-gateway:$TAG sha256:0"; echo "robot-preview:$TAG sha256:1" ;;
  save) echo "images" > "$2" ;;
esac
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "scripts").mkdir()
    script = tmp_path / "scripts/images"
    script.write_text(STAND_IN)
    script.chmod(0o755)
    return tmp_path


@pytest.mark.parametrize(("platform", "tag"), [("linux/amd64", "1.4.0"), ("linux/arm64", "1.4.0-arm64")])
def test_those_of_another_processor_have_a_tag_of_their_own(root: Path, platform: str, tag: str) -> None:
    assert build(root, "1.4.0", platform, 1767323045) == tag
    assert save(root, tag, root) == [f"robot-gateway:{tag}", f"robot-preview:{tag}"]
    calls = (root / "scripts/calls").read_text().splitlines()
    file = root / f"robot-images-{tag}.tar.gz"
    assert calls == [
        f"1.4.0 of 1767323045: build --platform {platform}",
        f"{tag}: ids",
        f"{tag}: save {file}",
    ]
    assert file.is_file()
    assert (root / "IMAGES").read_text().startswith(f"robot-gateway:{tag} sha256:0\n")


def test_with_the_newest_packages_where_that_is_asked(root: Path) -> None:
    build(root, "1.4.0", "linux/amd64", 1767323045, anew=True)
    assert (root / "scripts/calls").read_text().endswith(": build --platform linux/amd64 --no-cache\n")


@pytest.mark.parametrize("platform", PLATFORMS)
def test_the_tags_end_as_scripts_images_makes_them_on_x86_64(tmp_path: Path, platform: str) -> None:
    """By the script itself, with a Docker that writes down the tag."""
    for name in ("scripts/images", "docker/build-secrets.sh", "docker/empty", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    answers = "*Server.Version*) echo 28 ;; *Size*) echo 0 ;;"
    programs = {
        "uname": "echo x86_64",
        "docker/emulation": "",
        "docker/docker": f'echo "$TAG" > "$0.tag"; case "$*" in {answers} esac',
    }
    for name, body in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    subprocess.run(
        [tmp_path / "scripts/images", "build", "--ros", "packages", "--platform", platform],
        env={**os.environ, "PATH": f"{tmp_path}:{tmp_path}/docker:{os.environ['PATH']}", "TAG": "1.4.0"},
        capture_output=True, timeout=60, check=True,
    )  # fmt: skip
    assert (tmp_path / "docker/docker.tag").read_text() == f"1.4.0{PLATFORMS[platform]}\n"
