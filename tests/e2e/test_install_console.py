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


def install(home: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    dropped = {"XDG_DATA_HOME", "XDG_CONFIG_HOME", "VIRTUAL_ENV", "PYTHONPATH"}
    environment = {name: value for name, value in os.environ.items() if name not in dropped}
    return subprocess.run(
        [SCRIPT, *options],
        capture_output=True,
        text=True,
        timeout=DONE_WITHIN_S,
        # The homes are new, what is downloaded need not be.
        env=environment | {"HOME": str(home), "UV_CACHE_DIR": str(Path.home() / ".cache/uv")},
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
