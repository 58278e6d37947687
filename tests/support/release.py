"""A repository with this tree at its released commit, to release from, and the releases made from it."""

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
VERSION: Final = "9.8.7"
"""No version that the project has or soon gets."""
_RELEASE_WITHIN_S: Final = 400.0
_COMMITTED_AT: Final = "2026-01-02T03:04:05+00:00"


def released_repository(target: Path, version: str = VERSION) -> Path:
    """Returns a new repository of one commit: this tree, files not committed yet included, as `version`."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "-co", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target / name)
    raise_version(target, version)
    git(target, "init", "--quiet")
    commit(target)
    _use_tools(target)
    return target


def clone(repository: Path, target: Path) -> Path:
    """Returns a new clone of a released repository: its commit, and nothing that was made in it."""
    git(repository, "clone", "--quiet", repository, target)
    _use_tools(target)
    return target


def _use_tools(repository: Path) -> None:
    """Gives a repository the tools of this tree: to install them takes half a minute, or minutes."""
    subprocess.run([ROOT / "scripts/release", "--help"], stdout=subprocess.DEVNULL, check=True, timeout=400)
    (repository / ".cache").mkdir()
    (repository / ".cache/release").symlink_to(ROOT / ".cache/release")


def raise_version(repository: Path, version: str) -> None:
    """Does what CONTRIBUTING.md asks of a release, in files alone."""
    project = repository / "pyproject.toml"
    text, count = re.subn(
        r'^version = ".*"$', f'version = "{version}"', project.read_text(), flags=re.MULTILINE
    )
    assert count == 1
    project.write_text(text)
    changelog = repository / "CHANGELOG.md"
    text = changelog.read_text().replace(
        "## [Unreleased]", f"## [Unreleased]\n\n## [{version}] - 2026-01-02", 1
    )
    changelog.write_text(text)
    frozen = repository / "proto/locked"
    shutil.copy(max(frozen.glob("[0-9]*.binpb")), frozen / f"{version}.binpb")


def commit(repository: Path) -> None:
    """Commits everything, at a time that is the same in each run."""
    git(repository, "add", "--all")
    git(repository, "commit", "--quiet", "--message", "a release")


def git(repository: Path, *words: str | Path) -> str:
    """The output of a git command, which reads no one's own settings."""
    environment = {
        **os.environ,
        **{
            f"GIT_{who}_{what}": "robot@example.org"
            for who in ("AUTHOR", "COMMITTER")
            for what in ("NAME", "EMAIL")
        },
        **{f"GIT_{who}_DATE": _COMMITTED_AT for who in ("AUTHOR", "COMMITTER")},
        "GIT_CONFIG_GLOBAL": os.devnull,
        "GIT_CONFIG_NOSYSTEM": "1",
    }
    return subprocess.run(
        ["git", *words],
        cwd=repository,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout


def release(
    repository: Path,
    *options: str | Path,
    version: str = VERSION,
    within_s: float = _RELEASE_WITHIN_S,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Runs the repository's scripts/release."""
    return subprocess.run(
        [repository / "scripts/release", version, *options],
        cwd="/",
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        timeout=within_s,
        check=False,
    )


def remove_images(repository: Path, *names: str) -> None:
    """Removes images built of a repository: those of these names, and those that had the names before."""
    revision = git(repository, "rev-parse", "HEAD").strip()
    dangling = ("--filter=dangling=true", f"--filter=label=org.opencontainers.image.revision={revision}")
    listed = ["docker", "image", "ls", "--quiet", "--no-trunc", *dangling]
    left = subprocess.run(listed, capture_output=True, text=True, timeout=60, check=True).stdout.split()
    command = ["docker", "image", "rm", "--force", *names, *dict.fromkeys(left)]
    subprocess.run(command, capture_output=True, timeout=120, check=False)


def alone(*command: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs a command in a network namespace of its own: it reaches nothing, not even this machine."""
    dropped = ("PYTHONPATH", "VIRTUAL_ENV", "PIP_FIND_LINKS", "PIP_INDEX_URL", "PIP_EXTRA_INDEX_URL")
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return subprocess.run(
        ["unshare", "--map-root-user", "--net", *command],
        cwd="/",
        # What a machine's pip is set to look into is no part of a release.
        env={**kept, "PIP_CONFIG_FILE": os.devnull, **variables},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
