"""scripts/install-console in homes of its own; what it needs of Debian is there where tests are run."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts/install-console"
DONE_WITHIN_S = 300


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path


def install(home: Path, *options: str, programs: Path | None = None) -> "subprocess.CompletedProcess[str]":
    """Runs the script; `programs` are found before those of the system."""
    dropped = {"XDG_DATA_HOME", "XDG_CONFIG_HOME", "VIRTUAL_ENV", "PYTHONPATH"}
    environment = {name: value for name, value in os.environ.items() if name not in dropped}
    return subprocess.run(
        [SCRIPT, *options],
        capture_output=True,
        text=True,
        timeout=DONE_WITHIN_S,
        # The homes are new, what is downloaded need not be.
        env=environment
        | {"HOME": str(home), "UV_CACHE_DIR": str(Path.home() / ".cache/uv")}
        | ({"PATH": f"{programs}:{os.environ['PATH']}"} if programs else {}),
        cwd="/",
        check=False,
    )


@pytest.mark.timeout(DONE_WITHIN_S + 60)
def test_installed_once_used_and_taken_away(home: Path) -> None:
    first = install(home, "--without-video")
    assert first.returncode == 0, first.stderr
    assert "done in" in first.stderr
    assert "is not in PATH" in first.stderr
    link = home / ".local/bin/robotctl"
    environments = sorted((home / ".local/share/robot-gateway").glob("*/bin/robotctl"))
    assert [link.resolve()] == environments
    assert not list(link.resolve().parents[1].glob("lib/*/site-packages/PySide6*"))
    shown = subprocess.run([link, "--version"], capture_output=True, text=True, check=True)
    assert shown.stdout.startswith("robotctl ")

    again = install(home, "--without-video")
    assert again.returncode == 0
    assert "up to date" in again.stderr
    assert link.resolve() == environments[0]

    gone = install(home, "--uninstall")
    assert gone.returncode == 0
    assert not link.is_symlink()
    assert not (home / ".local/share/robot-gateway").exists()


def test_what_others_put_there_is_not_touched(home: Path) -> None:
    link = home / ".local/bin/robotctl"
    link.parent.mkdir(parents=True)
    link.write_text("mine")
    for options in ((), ("--uninstall",)):
        ended = install(home, *options)
        assert ended.returncode == 1
        assert ended.stderr == f"install-console: {link} is something else. Move it away and try again\n"
    assert link.read_text() == "mine"


def program(directory: Path, name: str, body: str) -> None:
    (directory / name).write_text(f"#!/bin/sh\n{body}\n")
    (directory / name).chmod(0o755)


@pytest.fixture
def arm64(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Programs that say what they would on arm64 with Debian 12."""
    directory = tmp_path_factory.mktemp("programs")
    program(directory, "uname", "echo aarch64")
    program(directory, "getconf", "echo glibc 2.36")
    return directory


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (
            (),
            "on arm64, the windows need the C library 2.39 of Ubuntu 24.04 or Debian 13, and this is 2.36. "
            "Type: scripts/install-console --without-video",
        ),
        (
            ("--release", "/nowhere"),
            "the wheels of a release are for x86-64, and this computer has arm64. With network, "
            "leave out --release",
        ),
    ],
)
def test_on_arm64_it_says_what_does_not_exist(
    home: Path, arm64: Path, options: tuple[str, ...], why: str
) -> None:
    """The defect: pip found no wheel, and the script asked for the network."""
    ended = install(home, *options, programs=arm64)
    assert (ended.returncode, ended.stderr) == (1, f"install-console: {why}\n")
    assert not list(home.iterdir())


def test_on_arm64_with_a_newer_system_it_goes_on(home: Path, arm64: Path) -> None:
    """To the next step, which is to install packages."""
    program(arm64, "getconf", "echo glibc 2.39")
    program(arm64, "dpkg-query", "exit 1")
    program(arm64, "id", "echo 0")
    program(arm64, "apt-get", "echo no packages today; exit 1")
    ended = install(home, programs=arm64)
    assert ended.returncode == 1
    assert "apt-get failed" in ended.stderr


def test_an_option_it_does_not_know_changes_nothing(home: Path) -> None:
    ended = install(home, "--video")
    assert ended.returncode == 2
    assert "unknown: --video" in ended.stderr
    assert not list(home.iterdir())


def test_help_says_what_it_does(home: Path) -> None:
    ended = install(home, "--help")
    assert ended.returncode == 0
    assert "--without-video" in ended.stdout
    assert not list(home.iterdir())
