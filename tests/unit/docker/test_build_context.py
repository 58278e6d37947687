"""What the images' Dockerfiles copy or mount reaches the build: .dockerignore lets nothing else through."""

import re
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parents[3]
DOCKERFILES = (
    "docker/gateway.Dockerfile",
    "docker/preview.Dockerfile",
    "docker/bridge.Dockerfile",
    "deploy/hub/hub.Dockerfile",
)
LET_THROUGH = frozenset(
    line.removeprefix("!")
    for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    if line.startswith("!")
)


@pytest.mark.parametrize("dockerfile", DOCKERFILES)
def test_what_a_dockerfile_takes_reaches_the_build(dockerfile: str) -> None:
    lines = (ROOT / dockerfile).read_text(encoding="utf-8").splitlines()
    copies = [line.split()[1:-1] for line in lines if line.startswith("COPY") and "--from=" not in line]
    sources = {word for words in copies for word in words if not word.startswith("--")}
    sources.update(
        source for line in lines for source in re.findall(r"--mount=type=bind,source=([^,]+),", line)
    )
    assert "docker/packages" in sources
    for source in sources:
        path = PurePosixPath(source)
        assert LET_THROUGH & {str(each) for each in (path, *path.parents)}, f"{source} is ignored"
        assert (ROOT / source).exists()
