"""A whole robot in containers, brought to a release made by scripts/release, and back.

Once it is a robot of this tree, and once one of version 0.1.0, whose images are built from its commit.
"""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.client.blocking import GatewayClient
from console.client.errors import GatewayError
from console.client.results import PreviewState
from console.credentials import Credentials
from console.robots.login import parse_login
from tests.support.engine import ROOT, TAG
from tests.support.free import free_domain, free_tcp_port, free_udp_port
from tests.support.patient import PATIENT
from tests.support.release import VERSION, release, released_repository, remove_images
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(1500)]

IMAGES = ("robot-gateway", "robot-preview", "robot-drive", "robot-recorder", "robot-bridge")
EARLIER = "0.1.0"
EARLIER_COMMIT = "badc0ba97b4cba1539f9ab04e308ae2d04d82a24"
EARLIER_TAG = f"e2e-{EARLIER}"
AUDIT = "/var/lib/robot-gateway/audit/audit.jsonl"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, images: str) -> Iterator[Path]:  # noqa: ARG001  # for its effect
    directory = tmp_path_factory.mktemp("release")
    repository = released_repository(directory / "repository")
    # The tree's own settings, as of the robot whose images these are.
    (repository / ".env").write_text("COMPOSE_FILE=compose.yaml\n")
    # As docker/test-images builds them: no robot gets them.
    wheels = {"ROS": "wheels", "ALLOW_STAND_INS": "1"}
    ended = release(
        repository, "--python", "3.11", "--output", directory / "made", within_s=1200, environment=wheels
    )
    assert ended.returncode == 0, ended.stderr
    yield directory / "made"
    remove_images(repository, *(f"{image}:{VERSION}" for image in IMAGES))


@pytest.fixture
def robot(tmp_path: Path, images: str) -> Iterator[tuple[Path, int]]:  # noqa: ARG001  # for its effect
    """The directory of a running robot that records, of this tree's images, and its gateway's port."""
    directory = tmp_path / "robot"
    directory.mkdir()
    for name in ("compose.yaml", "compose.demo.yaml", "docker", "scripts"):
        path = ROOT / name
        (shutil.copytree if path.is_dir() else shutil.copy)(path, directory / name)
    config = directory / "docker/config/gateway.yaml"
    config.write_text(config.read_text().replace("name: robot-gateway", "name: lab7"))
    port = free_tcp_port()
    with free_domain() as domain:
        settings = {
            "COMPOSE_PROJECT_NAME": f"robot-upgrade-e2e-{port}",
            "COMPOSE_FILE": "compose.yaml:compose.demo.yaml",
            "COMPOSE_PROFILES": "record",
            "ROBOT_RECORDS": "true",
            "ROS_DOMAIN_ID": str(domain),
            "GATEWAY_PORT": str(port),
            "PREVIEW_PORT": str(free_udp_port()),
            "PREVIEW_BIND": "127.0.0.1",
            "TAG": TAG,
        }
        (directory / ".env").write_text("".join(f"{name}={value}\n" for name, value in settings.items()))
        try:
            compose(directory, "up", "--detach")
            yield directory, port
        finally:
            compose(directory, "down", "--volumes", "--timeout", "5")


@pytest.fixture
def earlier_robot(tmp_path: Path) -> Iterator[tuple[Path, int]]:
    """The same of version 0.1.0, built from its commit; callers need credentials, and it is not started."""
    found = subprocess.run(
        ["git", "cat-file", "-e", f"{EARLIER_COMMIT}^{{commit}}"], cwd=ROOT, capture_output=True, check=False
    )
    if found.returncode != 0:
        pytest.skip(f"this repository lacks the commit of {EARLIER}. Type: git fetch --unshallow")
    directory = tmp_path / "robot"
    directory.mkdir()
    archive = tmp_path / "archive.tar"
    subprocess.run(["git", "archive", "--output", archive, EARLIER_COMMIT], cwd=ROOT, check=True)
    subprocess.run(["tar", "-xf", archive, "-C", directory], check=True)
    built = subprocess.run(
        [directory / "scripts/images", "build", "--ros", "wheels"],
        env={**os.environ, "TAG": EARLIER_TAG, "COMPOSE_FILE": "compose.yaml"},
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    config = directory / "docker/config/gateway.yaml"
    config.write_text(config.read_text().replace("name: robot-gateway", "name: lab7"))
    port = free_tcp_port()
    with free_domain() as domain:
        settings = {
            "COMPOSE_PROJECT_NAME": f"robot-upgrade-e2e-{port}",
            "COMPOSE_FILE": "compose.yaml:compose.demo.yaml:compose.guarded.yaml",
            "ROS_DOMAIN_ID": str(domain),
            "GATEWAY_PORT": str(port),
            "PREVIEW_PORT": str(free_udp_port()),
            "TAG": EARLIER_TAG,
        }
        (directory / ".env").write_text("".join(f"{name}={value}\n" for name, value in settings.items()))
        try:
            yield directory, port
        finally:
            compose(directory, "down", "--volumes", "--timeout", "5")
            tags = (EARLIER_TAG, f"before-{VERSION}")
            names = [f"{image}:{tag}" for image in IMAGES[:2] for tag in tags]
            subprocess.run(["docker", "image", "rm", "--force", *names], capture_output=True, check=False)


def compose(directory: Path, *words: str) -> str:
    """Returns what a `docker compose` command prints."""
    return subprocess.run(
        ["docker", "compose", "--progress", "quiet", *words],
        cwd=directory, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=180, check=True,
    ).stdout  # fmt: skip


def upgrade(directory: Path, *words: str | Path) -> None:
    """Runs scripts/upgrade-robot of a tree."""
    ended = subprocess.run(
        [directory / "scripts/upgrade-robot", *words],
        cwd="/", capture_output=True, text=True, timeout=400, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr


def seen(port: int) -> tuple[str, str, list[str]]:
    """The robot's name, the version that runs, and its recordings; waits until all of it answers."""

    def asked() -> tuple[str, str, list[str]] | None:
        try:
            with GatewayClient(f"127.0.0.1:{port}") as client:
                status = client.status()
                if not (status.health.ready and status.preview.service_reachable):
                    return None
                names = [each.id for each in client.recordings() if each.label == "kept"]
                return status.gateway_name, status.gateway_version, names
        except GatewayError:
            return None

    return wait_until(asked, "the robot answers and is complete", 60)


def test_a_robot_is_upgraded_and_taken_back_with_its_recordings_and_its_name(
    made: Path, robot: tuple[Path, int]
) -> None:
    directory, port = robot
    name, old, recordings = seen(port)
    assert (name, recordings) == ("lab7", [])
    assert old != VERSION
    with GatewayClient(f"127.0.0.1:{port}") as client:
        kept = client.start_recording("kept", with_video=False).recording.id
        client.stop_recording(kept)

    upgrade(directory, made)
    assert seen(port) == ("lab7", VERSION, [kept])
    upgrade(directory, "--rollback")
    assert seen(port) == ("lab7", old, [kept])


def plays(port: int, anna: Credentials) -> tuple[str, str]:
    """The robot's name and version, as soon as anna may call and the preview runs for her; then it is off."""

    def asked() -> tuple[str, str] | None:
        try:
            with GatewayClient(f"127.0.0.1:{port}", PATIENT, anna) as client:
                status = client.status()
                if not (status.health.ready and status.preview.service_reachable):
                    return None
                if client.enable_preview().preview.state is not PreviewState.RUNNING:
                    return None
                client.disable_preview()
                return status.gateway_name, status.gateway_version
        except GatewayError:
            return None

    return wait_until(asked, "the robot answers anna, and its preview runs", 60)


def audited(directory: Path) -> list[str]:
    return compose(directory, "exec", "-T", "gateway", "cat", AUDIT).splitlines()


def test_a_robot_of_0_1_0_is_upgraded_and_taken_back_with_its_credentials(
    made: Path, earlier_robot: tuple[Path, int], tmp_path: Path
) -> None:
    """By the script of the release: that version had none."""
    directory, port = earlier_robot
    compose(directory, "run", "--rm", "-T", "credentials", "init")
    login = compose(directory, "run", "--rm", "-T", "credentials", "add", "anna", "--role", "operator")
    anna = parse_login(login).credentials
    compose(directory, "up", "--detach")
    assert plays(port, anna) == ("lab7", EARLIER)
    before = audited(directory)
    assert before

    tree = tmp_path / "tree"
    tree.mkdir()
    archive = made / f"robot-gateway-{VERSION}.tar.gz"
    subprocess.run(["tar", "-xf", archive, "-C", tree, "--strip-components=1"], check=True)
    upgrade(tree, "--robot", directory, made)
    assert plays(port, anna) == ("lab7", VERSION)
    during = audited(directory)
    assert during[: len(before)] == before
    assert len(during) > len(before)

    upgrade(tree, "--robot", directory, "--rollback")
    assert plays(port, anna) == ("lab7", EARLIER)
    assert audited(directory)[: len(during)] == during
    upgrade(tree, "--robot", directory, "--rollback")
    assert plays(port, anna) == ("lab7", VERSION)


def test_the_images_are_named_with_their_digests(made: Path) -> None:
    listed = dict(line.split() for line in (made / "images/IMAGES").read_text().splitlines())
    assert set(listed) == {f"{image}:{VERSION}" for image in IMAGES}
    for image, digest in listed.items():
        shown = subprocess.run(
            ["docker", "image", "inspect", "--format", "{{.Id}}", image],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        assert shown.strip() == digest


@pytest.mark.parametrize(
    ("image", "package", "distribution"),
    [("robot-gateway", "python3", "grpcio"), ("robot-preview", "gstreamer1.0-plugins-bad", "pydantic")],
)
def test_the_sbom_of_an_image_has_what_is_in_it(
    made: Path, image: str, package: str, distribution: str
) -> None:
    bom = json.loads((made / f"sbom/{image}-{VERSION}.cdx.json").read_text())
    assert (bom["bomFormat"], bom["metadata"]["component"]["name"]) == ("CycloneDX", image)
    found = {component["purl"].partition("@")[0]: component for component in bom["components"]}
    inside = subprocess.run(
        ["docker", "run", "--rm", "--network=none", "--entrypoint=dpkg-query", f"{image}:{VERSION}",
         "--show", "--showformat=${Version}", package],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert found[f"pkg:deb/debian/{package}"]["version"] == inside
    assert "distro=debian-12" in found[f"pkg:deb/debian/{package}"]["purl"]
    assert f"pkg:pypi/{distribution}" in found
    assert found["pkg:pypi/robot-gateway"]["version"] == VERSION
