"""Whatever builds the project from a part of its tree has every package of it."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

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


def stages(dockerfile: str) -> dict[str, str]:
    """The text of each stage, from its FROM on, by its name."""
    parts = re.split(r"^(?=FROM )", dockerfile, flags=re.MULTILINE)[1:]
    return {part.split("\n", 1)[0].rpartition(" AS ")[2]: part for part in parts}


def base_of(stage: str) -> str:
    return stage.split()[1]


def test_the_bridges_image_has_the_zones_of_its_settings() -> None:
    """Named, because a base image need not have them."""
    by_name = stages((ROOT / "docker/bridge.Dockerfile").read_text())
    assert base_of(list(by_name.values())[-1]) == "system", "what runs begins with these packages"
    installed = re.search(r"/run/packages install (.*)", by_name["system"])
    assert installed
    assert "tzdata" in installed[1].split()


def test_stand_ins_are_refused_in_every_image_with_ros_unless_it_is_said_that_no_robot_runs_it() -> None:
    compose = yaml.safe_load((ROOT / "compose.yaml").read_text())
    built_here = [each["build"] for each in compose["services"].values() if "build" in each]
    with_ros = [each for each in built_here if each["dockerfile"] == "docker/gateway.Dockerfile"]
    assert {each["target"] for each in with_ros} == {"gateway", "drive", "recorder"}
    assert {each["args"]["ALLOW_STAND_INS"] for each in with_ros} == {"${ALLOW_STAND_INS:-}"}
    by_name = stages((ROOT / "docker/gateway.Dockerfile").read_text())
    assert {base_of(by_name[each["target"]]) for each in with_ros} == {"installed"}
    assert set(re.findall(r"--from=(\S+)", by_name["installed"])) == {"built"}
    built = by_name["built"]
    assert base_of(built) == "rclpy-${ROS}", "wherever ROS comes from"
    assert "\nARG ALLOW_STAND_INS=\n" in built
    assert '\nRUN [ "$ALLOW_STAND_INS" = 1 ] || docker/refuse-stand-ins /opt\n' in built


def test_only_the_images_of_tests_are_built_with_stand_ins() -> None:
    said = [
        path.relative_to(ROOT).as_posix()
        for folder in ("docker", "scripts", ".ci", "deploy")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and re.search(rb"^[^#]*ALLOW_STAND_INS=1 [A-Z]", path.read_bytes(), re.MULTILINE)
    ]
    assert said == ["docker/test-images"]
