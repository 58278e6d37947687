"""scripts/upgrade-robot without an engine: docker is a stand-in, by which all containers become healthy."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCKER = """#!/bin/sh
echo "$*" >> "$SEEN/commands"
case "$*" in
  # Where the real one may ask.
  compose*" up "*) cat >> "$SEEN/read"; sleep "${UP_TAKES_S:-0}" ;;
  compose*" run "*) cat >> "$SEEN/read" ;;
  compose*"config --services") printf 'gateway-config\\ngateway\\n' ;;
  compose*"config --images"*) echo robot-gateway:any ;;
  compose*config) echo 'name: robot' ;;
  compose*" ps --all --quiet gateway") echo 0123456789ab ;;
  inspect*State.Health*)
    # The engine's first check comes some time after the start.
    if [ -e "$SEEN/checked" ]; then echo healthy; else echo starting; fi
    touch "$SEEN/checked" ;;
esac
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """The directory of a robot that runs 9.1.0, and before it 1.0.0, which has no scripts/upgrade-robot."""
    directory = tmp_path / "a robot"
    before = directory / ".upgrade/trees/1.0.0"
    before.mkdir(parents=True)
    (directory / ".env").write_text("OWN=1\nTAG=9.1.0\n")
    (directory / ".upgrade/previous").write_text("1.0.0\n")
    (directory / "compose.yaml").write_text("# 9.1.0\n")
    (before / "compose.yaml").write_text("# 1.0.0\n")
    for scripts in (directory / "scripts", before / "scripts"):
        scripts.mkdir()
    for name in ("upgrade-robot", "robot-directory.sh", "images"):
        shutil.copy(ROOT / "scripts" / name, directory / "scripts")
    docker = tmp_path / "bin/docker"
    docker.parent.mkdir()
    docker.write_text(DOCKER)
    docker.chmod(0o755)
    (tmp_path / "read").touch()
    return directory


def run(robot: Path, *command: str | Path, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Runs a command; its input says yes to everything."""
    seen = robot.parent
    path = f"{seen / 'bin'}:{os.environ['PATH']}"
    return subprocess.run(
        command,
        env={**os.environ, "PATH": path, "SEEN": str(seen), **environment},
        input="y\n" * 9,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.fixture
def back(robot: Path) -> "subprocess.CompletedProcess[str]":
    """A rollback that has ended well."""
    ended = run(robot, ROOT / "scripts/upgrade-robot", "--robot", robot, "--rollback")
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
    way = shlex.split(back.stderr.rstrip().rpartition("Forth to 9.1.0: ")[2])
    script = robot / ".upgrade/trees/9.1.0/scripts/upgrade-robot"
    assert way == [str(script), "--robot", str(robot), "--rollback"]
    forth = run(robot, *way)
    assert forth.returncode == 0, forth.stderr
    assert (robot / ".env").read_text() == "OWN=1\nTAG=9.1.0\n"
    assert (robot / "scripts/upgrade-robot").exists()


def test_the_time_to_become_healthy_begins_with_the_start(robot: Path) -> None:
    """The defect: while Docker replaced the containers it went by, and a healthy release was left."""
    slow = {"UPGRADE_HEALTHY_WITHIN_S": "5", "UP_TAKES_S": "5"}
    ended = run(robot, ROOT / "scripts/upgrade-robot", "--robot", robot, "--rollback", **slow)
    assert ended.returncode == 0, ended.stderr
    assert (robot / ".env").read_text() == "OWN=1\nTAG=1.0.0\n"
