"""Two builds of a commit make the same images, and the same archive of them."""

import hashlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.release import clone, released_repository, remove_images

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(3000)]

IMAGES = ("robot-gateway", "robot-preview", "robot-drive", "robot-recorder", "robot-bridge")
TAG = "e2e-same"
BUILT_WITHIN_S = 1100
CREATED_S = "1767323045"


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    directory = released_repository(tmp_path_factory.mktemp("same") / "repository")
    yield directory
    remove_images(directory, *(f"{image}:{TAG}" for image in IMAGES))


def identity(image: str) -> str:
    return subprocess.run(
        ["docker", "image", "inspect", "--format={{.Id}}", f"{image}:{TAG}"],
        capture_output=True, text=True, timeout=60, check=True,
    ).stdout  # fmt: skip


def made(tree: Path, images: tuple[str, ...], *options: str, **variables: str) -> tuple[list[str], str]:
    """Builds and saves images of a tree; returns their IDs, and the SHA-256 of the archive."""
    environment = {
        **os.environ,
        "COMPOSE_FILE": "compose.yaml",
        "TAG": TAG,
        # As docker/test-images builds them: no robot gets them.
        "ROS": "wheels",
        "ALLOW_STAND_INS": "1",
        "SOURCE_DATE_EPOCH": CREATED_S,
        **variables,
    }
    file = tree.parent / f"{tree.name}.tar.gz"
    for words in (["build", *options, *images], ["save", str(file), *images]):
        ended = subprocess.run(
            [tree / "scripts/images", *words],
            env=environment, capture_output=True, text=True, timeout=BUILT_WITHIN_S, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, ended.stderr[-3000:]
    with file.open("rb") as archive:
        sha256 = hashlib.file_digest(archive, "sha256").hexdigest()
    file.unlink()
    return [identity(image) for image in images], sha256


@pytest.mark.parametrize("images", [("robot-bridge",), IMAGES], ids=["smallest", "all"])
def test_two_builds_of_a_commit_are_the_same_images(
    repository: Path, tmp_path: Path, images: tuple[str, ...]
) -> None:
    """The second one from another clone, in another project and with another umask.

    Both without the cache, which may have the packages of another day.
    """
    first = made(repository, images, "--no-cache")
    before = os.umask(0o077)
    try:
        other = clone(repository, tmp_path / "elsewhere")
        second = made(other, images, "--no-cache", COMPOSE_PROJECT_NAME="another", TZ="Asia/Tokyo")
    finally:
        os.umask(before)
    assert first == second


def test_what_python_has_compiled_is_taken(repository: Path) -> None:
    """Python compares the time of a module with that of what was compiled of it; all files have one now."""
    made(repository, ("robot-bridge",))
    run = ("run", "--rm", "--network=none", "--read-only", "--entrypoint=python", f"robot-bridge:{TAG}", "-v")
    ended = subprocess.run(
        ["docker", *run, "-c", "import asyncio, grpc, bridge.cli"],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    loaded = [line for line in ended.stderr.splitlines() if line.startswith("# code object from ")]
    assert [line for line in loaded if not line.endswith(".pyc'")] == []
    assert len(loaded) > 300
