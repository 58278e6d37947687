"""`scripts/install-robot --release DIR`: what is refused. test_release.py installs from a real release."""

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.support.release import git

pytestmark = pytest.mark.skipif(shutil.which("systemctl") is None, reason="what it installs runs on systemd")
ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
OTHER = "0" * 40


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A release of this very tree, as far as the script looks before it installs."""
    directory = tmp_path / "usb stick"
    (directory / "robot").mkdir(parents=True)
    (directory / "robot/uv-1-py3-none-any.whl").write_bytes(b"a wheel")
    return named(directory, VERSION, revision())


def revision() -> str:
    """The commit of this tree; a copy of it has none."""
    if not (ROOT / ".git").exists():
        return OTHER
    return git(ROOT, "rev-parse", "HEAD").strip()


def named(directory: Path, version: str, commit: str) -> Path:
    (directory / "RELEASE").write_text(f"VERSION={version}\nREVISION={commit}\n")
    listed = subprocess.run(
        ["sha256sum", "RELEASE", *(f"robot/{each.name}" for each in directory.glob("robot/*"))],
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=30,
        check=True,
    )
    (directory / "SHA256SUMS").write_text(listed.stdout)
    return directory


def refused(directory: Path | str, *options: str, cwd: Path = ROOT) -> str:
    """What the script says; it is to refuse in one line, before it looks at anything else of this machine."""
    done = subprocess.run(
        [ROOT / "scripts/install-robot", "--dry-run", *options, "--release", directory],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode in {1, 2}, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("directory", "sentence"),
    [
        ("nowhere", "there is no directory nowhere"),
        ("", "--release takes a directory"),
        (".", "is no release: it has no SHA256SUMS"),
    ],
)
def test_what_is_no_release_is_refused(tmp_path: Path, directory: str, sentence: str) -> None:
    assert sentence in refused(directory, cwd=tmp_path)


def test_a_release_without_programs_for_robots_is_refused(made: Path) -> None:
    (made / "robot/uv-1-py3-none-any.whl").unlink()
    (made / "robot").rmdir()
    assert "is a release without what robots without Docker need" in refused(made)


@pytest.mark.parametrize("damaged", ["robot/uv-1-py3-none-any.whl", "RELEASE"])
def test_a_damaged_release_is_refused(made: Path, damaged: str) -> None:
    with (made / damaged).open("ab") as file:
        file.write(b"x")
    assert "is damaged or incomplete, nothing was changed. Copy it again" in refused(made)


def test_a_tree_of_another_version_names_the_command_for_that_of_the_release(made: Path) -> None:
    said = refused(named(made, "9.8.7", OTHER))
    assert "the release is 9.8.7, and this tree is not. Type: tar -xf " in said
    assert "sudo robot-gateway-9.8.7/scripts/install-robot --release " in said


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="a copy of the tree has no commit")
def test_a_tree_of_another_commit_is_refused_as_well(made: Path) -> None:
    assert f"the release is {VERSION}, and this tree is not" in refused(named(made, VERSION, OTHER))


def test_ros_is_not_part_of_a_release(made: Path) -> None:
    assert "a release has no ROS 2. Install ROS 2 Jazzy" in refused(made, "--ros", "wheels")


@pytest.mark.parametrize("mode", ["--rollback", "--uninstall"])
def test_nothing_but_installing_takes_a_release(made: Path, mode: str) -> None:
    assert f"--release is for installing, not for {mode}" in refused(made, mode)
