"""scripts/upgrade-robot without an engine: docker is a stand-in, by which all containers are healthy."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCKER = """#!/bin/sh
echo "$*" >> "$SEEN/commands"
case "$*" in
  # Where the real one may ask.
  compose*" up "* | compose*" run "*) cat >> "$SEEN/read" ;;
  compose*"config --services") printf 'gateway-config\\ngateway\\n' ;;
  compose*"config --images"*) echo robot-gateway:any ;;
  compose*config) echo 'name: robot' ;;
  compose*" ps --all --quiet gateway") echo 0123456789ab ;;
  inspect*State.Health*) echo healthy ;;
esac
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """The directory of a robot that runs 9.1.0, and before it 1.0.0, which has no scripts/upgrade-robot."""
    directory = tmp_path / "robot"
    before = directory / ".upgrade/trees/1.0.0"
    before.mkdir(parents=True)
    (directory / ".env").write_text("OWN=1\nTAG=9.1.0\n")
    (directory / ".upgrade/previous").write_text("1.0.0\n")
    (directory / "compose.yaml").write_text("# 9.1.0\n")
    (before / "compose.yaml").write_text("# 1.0.0\n")
    for scripts in (directory / "scripts", before / "scripts"):
        scripts.mkdir()
    (directory / "scripts/upgrade-robot").touch()
    return directory


@pytest.fixture
def back(robot: Path, tmp_path: Path) -> "subprocess.CompletedProcess[str]":
    """A rollback that has ended well; its input says yes to everything."""
    docker = tmp_path / "bin/docker"
    docker.parent.mkdir()
    docker.write_text(DOCKER)
    docker.chmod(0o755)
    (tmp_path / "read").touch()
    ended = subprocess.run(
        [ROOT / "scripts/upgrade-robot", "--robot", robot, "--rollback"],
        env={**os.environ, "PATH": f"{docker.parent}:{os.environ['PATH']}", "SEEN": str(tmp_path)},
        input="y\n" * 9,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return ended


@pytest.mark.usefixtures("back")
def test_what_compose_asks_gets_no_answer_from_the_callers_input(robot: Path, tmp_path: Path) -> None:
    """The defect: at a terminal an upgrade from 0.1.0 stopped, and waited for a word on a volume."""
    assert (robot / ".env").read_text() == "OWN=1\nTAG=1.0.0\n"
    assert (robot / "compose.yaml").read_text() == "# 1.0.0\n"
    commands = (tmp_path / "commands").read_text().splitlines()
    checks = [line for line in commands if " run " in line and line.endswith("gateway-config")]
    starts = [line for line in commands if line.endswith(" up --detach gateway")]
    assert (len(checks), len(starts)) == (1, 1)
    assert (tmp_path / "read").read_text() == ""


def test_the_way_forth_from_a_version_without_the_script_is_named(
    robot: Path, back: "subprocess.CompletedProcess[str]"
) -> None:
    """The defect: it named scripts/upgrade-robot, which was gone."""
    assert not (robot / "scripts/upgrade-robot").exists()
    script = robot / ".upgrade/trees/9.1.0/scripts/upgrade-robot"
    assert script.exists()
    assert back.stderr.rstrip().endswith(f"Forth to 9.1.0: {script} --robot {robot} --rollback")
