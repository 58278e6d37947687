"""`scripts/lock --check` fails when requirements and lock files do not match, without a network."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FROM_PYPROJECT = [
    "dev",
    "gateway",
    "preview",
    "recorder",
    "bridge",
    "hub",
    "console",
    "ros-wheels",
    "preview-image",
]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of everything that locking reads, for tests to change."""
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts/lock", tmp_path / "scripts")
    return tmp_path


def mismatches(project: Path) -> list[str]:
    """Names of the lock files that the check rejects."""
    check = subprocess.run(
        [project / "scripts/lock", "--check"], capture_output=True, text=True, timeout=30, check=False
    )
    lines = check.stderr.splitlines()
    assert all(line.endswith("does not match its requirements. Type: scripts/lock") for line in lines)
    assert check.returncode == (1 if lines else 0)
    return [Path(line.split()[1]).stem for line in lines]


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times in {file}"
    file.write_text(text.replace(old, new))


def test_the_committed_lock_files_match() -> None:
    assert mismatches(ROOT) == []


def test_every_lock_file_is_checked() -> None:
    locked = {file.stem for file in (ROOT / "requirements").glob("*.txt") if "--hash=" in file.read_text()}
    declared = {file.stem for file in (ROOT / "requirements").glob("*.in")}
    assert locked == {*FROM_PYPROJECT, *declared}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        pytest.param('  "typer>=0.29",\n', '  "typer>=0.28",\n', id="bound changed"),
        pytest.param('  "typer>=0.29",\n', "", id="dependency removed"),
        pytest.param('  "hypothesis', '  "tomlkit",\n  "hypothesis', id="development dependency added"),
        pytest.param('requires-python = ">=3.11"', 'requires-python = ">=3.12"', id="Python raised"),
    ],
)
def test_a_changed_dependency_needs_new_lock_files(project: Path, old: str, new: str) -> None:
    edit(project / "pyproject.toml", old, new)
    assert mismatches(project) == FROM_PYPROJECT


def test_a_changed_in_file_needs_its_lock_file_anew(project: Path) -> None:
    edit(project / "requirements/tools.in", "\nuv\n", "\nuv>=0.9\n")
    assert mismatches(project) == ["tools"]


def test_an_edited_lock_file_is_rejected(project: Path) -> None:
    edit(project / "requirements/gateway.txt", "\ntyper==", "\ntyper==9")
    assert mismatches(project) == ["gateway"]


def test_what_does_not_touch_dependencies_needs_no_locking(project: Path) -> None:
    edit(project / "pyproject.toml", "line-length = 110", "line-length = 100")
    with (project / "requirements/tools.in").open("a") as file:
        file.write("# A comment.\n")
    assert mismatches(project) == []
