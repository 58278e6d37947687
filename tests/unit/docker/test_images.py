"""scripts/images without an engine: what it refuses, and what it warns of."""

import gzip
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def scripts_images(*words: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("ALLOW_STAND_INS", "ROS")}
    return subprocess.run(
        [ROOT / "scripts" / "images", *words],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env={**kept, **variables},
    )


@pytest.mark.parametrize(
    ("words", "variables"), [(["--ros", "wheels"], {}), ([], {"ROS": "wheels"})], ids=["option", "variable"]
)
def test_images_with_stand_ins_are_for_no_robot(words: list[str], variables: dict[str, str]) -> None:
    refused = scripts_images("build", *words, **variables)
    assert refused.returncode == 1
    assert "--ros packages" in refused.stderr
    assert "ALLOW_STAND_INS=1" in refused.stderr


@pytest.mark.parametrize(
    ("version", "bind", "warned"),
    [
        ("20.10.24+dfsg1", "127.0.0.1", True),
        ("27.5.1", "[::1]", True),
        ("28.0.0", "127.0.0.1", False),
        ("20.10.24", "0.0.0.0", False),  # noqa: S104  # binds nothing
    ],
)
def test_an_engine_that_shows_the_video_to_neighbours_is_named(
    tmp_path: Path, version: str, bind: str, warned: bool
) -> None:
    """Docker before 28 does, where it publishes a port on the loopback (moby issue 45610)."""
    docker, file = tmp_path / "docker", tmp_path / "images.tar.gz"
    docker.write_text(f'#!/bin/sh\n[ "$1" = load ] && cat > /dev/null || echo "{version}"\n')
    docker.chmod(0o755)
    file.write_bytes(gzip.compress(b"images"))
    loaded = scripts_images("load", file, PATH=f"{tmp_path}:{os.environ['PATH']}", PREVIEW_BIND=bind)
    assert loaded.returncode == 0, loaded.stderr
    assert (f"Docker {version} lets other machines" in loaded.stderr) is warned
    assert ("encrypted: true" in loaded.stderr) is warned
