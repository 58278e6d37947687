"""scripts/images on built images: what is in them, and the way to a robot that reaches no registry."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.support.engine import ROOT, TAG

pytestmark = [pytest.mark.docker, pytest.mark.timeout(900)]

IMAGES = ("robot-gateway", "robot-preview", "robot-drive", "robot-recorder", "robot-bridge")
CARRIED = "e2e-carried"


def scripts_images(*arguments: str, tag: str = TAG) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "scripts/images", *arguments],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "TAG": tag},
    )


def docker(*arguments: str) -> str:
    return subprocess.run(
        ["docker", *arguments], capture_output=True, text=True, timeout=60, check=True
    ).stdout


def contents_of(image: str) -> object:
    """What the image is made of and runs; its ID changes with the engine's way of storing it."""
    (found,) = json.loads(docker("image", "inspect", image))
    return found["RootFS"]["Layers"], found["Config"]["Cmd"]


@pytest.mark.usefixtures("images")
def test_each_package_is_listed_with_its_version() -> None:
    listed = [line.split() for line in scripts_images("packages").stdout.splitlines()]
    versions = {(image, package): version for image, package, version in listed}
    assert {image for image, _ in versions} == set(IMAGES)
    inside = docker(
        "run", "--rm", "--network=none", "--entrypoint=dpkg-query", f"robot-preview:{TAG}",
        "--show", "--showformat=${Version}", "gstreamer1.0-plugins-bad",
    )  # fmt: skip
    assert versions["robot-preview", "gstreamer1.0-plugins-bad"] == inside


@pytest.mark.usefixtures("images")
@pytest.mark.parametrize(("image", "package"), [("robot-hub", "tini"), ("robot-hub-nats", "libc6")])
def test_the_hubs_images_list_their_packages_with_versions(image: str, package: str) -> None:
    listed = docker(
        "run", "--rm", "--network=none", "--entrypoint=cat", f"{image}:{TAG}",
        "/usr/share/robot-gateway-packages.txt",
    )  # fmt: skip
    inside = docker(
        "run", "--rm", "--network=none", "--entrypoint=dpkg-query", f"{image}:{TAG}",
        "--show", "--showformat=${Version}", package,
    )  # fmt: skip
    assert f"{package} {inside}" in listed.splitlines()


@pytest.mark.usefixtures("images")
def test_the_hubs_server_is_listed_with_its_version() -> None:
    run = ("run", "--rm", "--network=none", "--entrypoint")
    listed = docker(*run, "cat", f"robot-hub-nats:{TAG}", "/usr/share/robot-gateway-packages.txt")
    says = docker(*run, "nats-server", f"robot-hub-nats:{TAG}", "--version")
    (version,) = (line.split()[1] for line in listed.splitlines() if line.startswith("nats-server "))
    # That of Debian's package has a revision behind it.
    assert version.partition("-")[0] == says.strip().rpartition("v")[2]


BASES = {"DEBIAN_IMAGE": "debian:bookworm-slim", "ROS_IMAGE": "ros:jazzy-ros-core"}


def id_of(image: str) -> str:
    """Empty where the engine has no such image."""
    asked = subprocess.run(
        ["docker", "image", "inspect", "--format={{.Id}}", image],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return asked.stdout.strip()


def digests_of(image: str) -> set[str]:
    """By which the engine knows it in its own repository; none of one that was made here."""
    if not id_of(image):
        return set()
    repository = image.partition(":")[0]
    known = json.loads(docker("image", "inspect", "--format={{json .RepoDigests}}", image)) or []
    return {each.partition("@")[2] for each in known if each.startswith(f"{repository}@")}


def test_a_base_image_is_named_by_a_digest_that_is_the_same_image() -> None:
    """Where tests run it was often made by docker/base-image.sh: then no registry knows it, which is said."""
    printed = scripts_images("digests")
    lines = dict(line.split("=", 1) for line in printed.stdout.splitlines())
    known = {variable: digests_of(image) for variable, image in BASES.items()}
    assert lines.keys() == {variable for variable, digests in known.items() if digests}
    for variable, image in BASES.items():
        if variable in lines:
            name, _, digest = lines[variable].partition("@")
            assert (name, digest in known[variable]) == (image, True)
            assert id_of(lines[variable]) == id_of(image)
        else:
            assert f"docker pull {image}" in printed.stderr
    assert (printed.returncode == 0) == all(known.values())


def build(image: str) -> None:
    """Builds an image on Debian's, which the others share, with a layer and a command of its own."""
    dockerfile = f'FROM debian:bookworm-slim\nRUN echo {image} > /name\nCMD ["cat", "/name"]\n'
    subprocess.run(
        ["docker", "build", "--quiet", "--network=none", "--tag", f"{image}:{CARRIED}", "-"],
        input=dockerfile,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )


def test_images_that_were_saved_and_loaded_are_the_same(tmp_path: Path) -> None:
    """Smaller ones than the robot's, whose 1 GiB takes a minute and says no more."""
    file = tmp_path / "images.tar.gz"
    for image in IMAGES:
        build(image)
    before = {image: contents_of(f"{image}:{CARRIED}") for image in IMAGES}
    assert before[IMAGES[0]] != before[IMAGES[1]]
    try:
        saved = scripts_images("save", str(file), tag=CARRIED)
        assert saved.returncode == 0, saved.stderr
        assert file.stat().st_size > 10_000_000
        listed = dict(line.split() for line in scripts_images("ids", tag=CARRIED).stdout.splitlines())
        assert listed == {
            f"{image}:{CARRIED}": docker("image", "inspect", "--format={{.Id}}", f"{image}:{CARRIED}").strip()
            for image in IMAGES
        }
        docker("image", "rm", *(f"{image}:{CARRIED}" for image in IMAGES))
        loaded = scripts_images("load", str(file), tag=CARRIED)
        assert loaded.returncode == 0, loaded.stderr
        assert {image: contents_of(f"{image}:{CARRIED}") for image in IMAGES} == before
        for image in IMAGES:
            assert docker("run", "--rm", "--network=none", f"{image}:{CARRIED}") == f"{image}\n"
    finally:
        docker("image", "rm", "--force", *(f"{image}:{CARRIED}" for image in IMAGES))


def test_the_names_are_those_of_the_robots_images() -> None:
    assert tuple(scripts_images("names").stdout.split()) == IMAGES


@pytest.mark.usefixtures("images")
def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "images.tar.gz"
    file.write_bytes(b"no archive")
    assert scripts_images("load", str(file)).returncode != 0


@pytest.mark.usefixtures("images")
def test_saving_what_was_not_built_leaves_no_file(tmp_path: Path) -> None:
    file = tmp_path / "images.tar.gz"
    ended = scripts_images("save", str(file), tag="never-built")
    assert ended.returncode == 1
    assert "scripts/images build" in ended.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("images")
def test_an_image_with_stand_ins_is_for_no_robot() -> None:
    """Also where compose builds it, without scripts/images, which refuses before it begins."""
    secrets = ". docker/build-secrets.sh && export BUILD_CA BUILD_INDEX"
    command = f"{secrets} && docker compose --progress plain build gateway"
    ended = subprocess.run(
        ["bash", "-c", command],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={
            **os.environ,
            "COMPOSE_FILE": "compose.yaml",
            "ROS": "wheels",
            "ALLOW_STAND_INS": "",
            "TAG": "no-robot",
        },
    )
    said = ended.stdout + ended.stderr
    assert ended.returncode != 0, said
    assert "stand-ins in an image for robots" in said
    assert "yolo_msgs" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--platform", "linux/arm64", "--ros", "wheels"],
            "the wheels exist for x86-64 only: --ros packages",
        ),
        (["--platform", "linux/riscv64"], "usage: scripts/images build"),
        (["robot-arm"], "usage: scripts/images build"),
    ],
)
def test_what_it_can_not_build_is_refused(words: list[str], said: str) -> None:
    refused = scripts_images("build", *words)
    assert refused.returncode != 0
    assert said in refused.stderr
    assert not refused.stdout
