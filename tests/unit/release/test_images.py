"""The images of a release, by a stand-in for scripts/images."""

from pathlib import Path

import pytest
from release_program.images import PLATFORMS, build, save

STAND_IN = """#!/bin/sh
echo "$TAG: $*" >> "$(dirname "$0")/calls"
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
    assert build(root, "1.4.0", platform) == tag
    assert save(root, tag, root) == [f"robot-gateway:{tag}", f"robot-preview:{tag}"]
    calls = (root / "scripts/calls").read_text().splitlines()
    file = root / f"robot-images-{tag}.tar.gz"
    assert calls == [f"1.4.0: build --platform {platform}", f"{tag}: ids", f"{tag}: save {file}"]
    assert file.is_file()
    assert (root / "IMAGES").read_text().startswith(f"robot-gateway:{tag} sha256:0\n")


def test_the_tags_end_as_scripts_images_makes_them_on_x86_64() -> None:
    """There, the images of this processor have no ending, and others that of their architecture."""
    assert {
        platform: f"-{platform.partition('/')[2]}" if platform != "linux/amd64" else ""
        for platform in PLATFORMS
    } == PLATFORMS
