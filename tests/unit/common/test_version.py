from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from common.version import REVISION_VARIABLE, project_revision, project_version

REVISION = "0123456789abcdef" * 2 + "01234567"


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv(REVISION_VARIABLE, raising=False)
    (tmp_path / "refs/heads").mkdir(parents=True)
    (tmp_path / "HEAD").write_text("ref: refs/heads/main\n", encoding="ascii")
    return tmp_path


def test_a_branch(repository: Path) -> None:
    (repository / "refs/heads/main").write_text(REVISION + "\n", encoding="ascii")
    assert project_revision(repository) == REVISION


def test_a_branch_that_git_has_packed(repository: Path) -> None:
    packed = f"# pack-refs with: peeled\n{'a' * 40} refs/heads/other\n{REVISION} refs/heads/main\n"
    (repository / "packed-refs").write_text(packed, encoding="ascii")
    assert project_revision(repository) == REVISION


def test_a_detached_head(repository: Path) -> None:
    (repository / "HEAD").write_text(REVISION, encoding="ascii")
    assert project_revision(repository) == REVISION


def test_the_environment_takes_precedence(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(REVISION_VARIABLE, REVISION.upper())
    assert project_revision(repository / "nowhere") == REVISION


@pytest.mark.parametrize("head", ["", "ref: refs/heads/gone", "not a revision"])
def test_an_unknown_revision_is_empty(repository: Path, head: str) -> None:
    (repository / "HEAD").write_text(head, encoding="ascii")
    assert project_revision(repository) == ""
    assert project_revision(repository / "nowhere") == ""


@pytest.mark.parametrize(
    ("installed", "expected"),
    [
        ({"robot-gateway": "1.2.0"}, "1.2.0"),
        ({"robot-gateway-client": "1.3.0"}, "1.3.0"),
        ({"robot-gateway": "1.2.0", "robot-gateway-client": "1.3.0"}, "1.2.0"),
        ({}, "0.0.0"),
    ],
)
def test_the_version_is_that_of_whichever_distribution_is_installed(
    installed: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def version(name: str) -> str:
        try:
            return installed[name]
        except KeyError:
            raise PackageNotFoundError(name) from None

    monkeypatch.setattr("importlib.metadata.version", version)
    assert project_version() == expected
