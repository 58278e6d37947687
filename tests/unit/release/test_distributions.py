"""The pyproject.toml of each distribution: names from the table, versions from the project's own."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from release_program.distributions import CLIENT, CONSOLE, DISTRIBUTIONS, Distribution, pyproject

ROOT = Path(__file__).parents[3]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def written(distribution: Distribution) -> dict[str, Any]:
    return tomllib.loads(pyproject(distribution, PROJECT, ["console"]))


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=lambda each: each.name)
def test_version_licence_and_python_are_the_projects(distribution: Distribution) -> None:
    project = written(distribution)["project"]
    for key in ("version", "license", "license-files", "requires-python"):
        assert project[key] == PROJECT[key]


def test_the_console_needs_the_client_of_its_own_version() -> None:
    needed = written(CONSOLE)["project"]["dependencies"]
    assert needed[0] == f"robot-gateway-client=={PROJECT['version']}"


def test_bounds_are_those_of_the_project() -> None:
    known = {text for extra in PROJECT["optional-dependencies"].values() for text in extra}
    known.update(PROJECT["dependencies"])
    assert set(written(CLIENT)["project"]["dependencies"]) < known
    assert set(written(CONSOLE)["project"]["dependencies"][1:]) < known


def test_qt_is_an_extra_of_the_console_and_nothing_of_the_client() -> None:
    assert any("PySide6" in text for text in written(CONSOLE)["project"]["optional-dependencies"]["video"])
    for distribution in DISTRIBUTIONS:
        assert not any("PySide6" in text for text in written(distribution)["project"]["dependencies"])
    assert not written(CLIENT)["project"]["optional-dependencies"]


def test_the_command_is_the_projects() -> None:
    assert written(CONSOLE)["project"]["scripts"] == {"robotctl": PROJECT["scripts"]["robotctl"]}


def test_a_dependency_that_the_project_does_not_have_is_refused() -> None:
    with pytest.raises(LookupError, match="unheard-of"):
        written(Distribution("x", "", "README.md", (), ("unheard-of",)))
