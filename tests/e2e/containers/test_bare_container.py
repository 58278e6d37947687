"""A release on computers that have nothing but Python: containers of the distribution, without network."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.release import VERSION, release, released_repository

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(1500)]

# With this package Debian's Python can make environments; nothing else is installed.
DOCKERFILE = """
FROM {base}
RUN apt-get update && apt-get install -y --no-install-recommends python3-venv && rm -rf /var/lib/apt/lists/*
"""
SYSTEMS = {"debian-12": "debian:bookworm-slim", "debian-13": "debian:trixie-slim"}
CLIENT = """
set -e
python3 -m venv /tmp/client
/tmp/client/bin/pip install --quiet --no-index --find-links /release/wheels robot-gateway-client=={version}
/tmp/client/bin/python -c '
import console.client
from common.version import project_version
print(project_version())'
"""
CONSOLE = """
set -e
mkdir /tmp/tree
tar -xf /release/robot-gateway-{version}.tar.gz -C /tmp/tree --strip-components=1
export HOME=/tmp
/tmp/tree/scripts/install-console --without-video --release /release >&2
/tmp/.local/bin/robotctl --version
/tmp/.local/bin/robotctl --target 127.0.0.1:1 status || echo "ended $?"
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A release for all Pythons, without images."""
    directory = tmp_path_factory.mktemp("release")
    ended = release(
        released_repository(directory / "repository"), "--without-images", "--output", directory / "made"
    )
    assert ended.returncode == 0, ended.stderr
    return directory / "made"


@pytest.fixture(params=SYSTEMS)
def system(request: pytest.FixtureRequest) -> Iterator[str]:
    """The image of a bare system with Python."""
    base, name = SYSTEMS[request.param], f"robot-gateway-bare-{request.param}"
    found = subprocess.run(["docker", "image", "inspect", base], capture_output=True, timeout=30, check=False)
    if found.returncode != 0:
        suite = base.partition(":")[2].removesuffix("-slim")
        pytest.skip(f"there is no image {base}. Type: docker/base-image.sh {suite}")
    built = subprocess.run(
        ["docker", "build", "--quiet", "--tag", name, "-"],
        input=DOCKERFILE.format(base=base), capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-3000:]
    yield name
    subprocess.run(["docker", "image", "rm", "--force", name], capture_output=True, timeout=60, check=False)


def inside(system: str, made: Path, script: str) -> list[str]:
    """Returns the lines that a shell script prints in a container of the system, which has no network."""
    ended = subprocess.run(
        ["docker", "run", "--rm", "--init", "--network=none", "--volume", f"{made}:/release:ro", system,
         "sh", "-c", script.format(version=VERSION)],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr[-3000:]
    return ended.stdout.splitlines()


def test_the_client_library_installs_where_no_registry_is(system: str, made: Path) -> None:
    assert inside(system, made, CLIENT) == [VERSION]


def test_robotctl_installs_where_no_registry_is(system: str, made: Path) -> None:
    version, *_, ended = inside(system, made, CONSOLE)
    assert version.startswith(f"robotctl {VERSION}")
    assert ended == "ended 3", "it works, and reaches no gateway"
