"""Several robots by name: `robotctl robots`, --robot, and which of all that was said counts."""

import json
import stat
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import only_line, robotctl
from tests.support.robotctl_docs import documented, holds


class Person:
    """A person with a home of their own, and robots called one and two that really answer."""

    def __init__(self, home: Path, targets: dict[str, str]) -> None:
        self.book = home / "robotctl/config.toml"
        self.targets = targets
        self._home = home

    def types(self, *words: str, **extra: str) -> Any:
        """Runs robotctl."""
        return robotctl(*words, XDG_CONFIG_HOME=str(self._home), **extra)

    def reaches(self, *words: str, **extra: str) -> str:
        """Which robot answers."""
        ended = self.types("status", "--json", *words, **extra)
        assert ended.returncode == 0, ended.stderr
        return str(json.loads(ended.stdout)["gateway_name"])


@pytest.fixture
def person(tmp_path: Path) -> Iterator[Person]:
    targets = {}
    with ExitStack() as stack:
        for name in ("one", "two", "three"):
            double = GatewayDouble()
            double.status.gateway_name = name
            targets[name] = f"127.0.0.1:{stack.enter_context(serving(double))}"
        person = Person(tmp_path, targets)
        for name in ("one", "two"):
            added = person.types("robots", "add", name, targets[name])
            assert (added.returncode, added.stderr) == (0, "")
        yield person


def test_who_speaks_first_is_meant(person: Person) -> None:
    three = person.targets["three"]
    environment = {"ROBOTCTL_TARGET": three, "ROBOTCTL_ROBOT": "two"}
    assert person.reaches() == "one", "the default, which is the first"
    assert person.reaches(ROBOTCTL_ROBOT="two") == "two"
    assert person.reaches(**environment) == "three"
    assert person.reaches("--robot", "two", ROBOTCTL_TARGET=three) == "two"
    assert person.reaches("--robot", "two", "--target", three) == "three"
    assert person.types("--robot", "nobody", "status", "--robot", "two").returncode == 0, "after goes first"


def test_the_default_moves_and_goes(person: Person) -> None:
    assert person.types("robots", "default", "two").returncode == 0
    assert person.reaches() == "two"
    assert person.types("robots", "remove", "two").returncode == 0
    document = json.loads(person.types("robots", "--json").stdout)
    assert document["default"] is None
    assert [robot["name"] for robot in document["robots"]] == ["one"]


def test_the_list_for_people(person: Person) -> None:
    listed = person.types("robots")
    assert (listed.returncode, listed.stderr) == (0, "")
    first, second = listed.stdout.splitlines()
    assert first.split() == ["one", person.targets["one"], "default"]
    assert second.split() == ["two", person.targets["two"]]


def test_an_empty_list_says_what_to_type(tmp_path: Path) -> None:
    listed = robotctl("robots", XDG_CONFIG_HOME=str(tmp_path))
    assert listed.returncode == 0
    assert "Type: robotctl robots add NAME HOST:PORT" in listed.stdout
    assert not list(tmp_path.iterdir()), "looking makes nothing"


def test_a_known_name_is_not_taken_by_accident(person: Person) -> None:
    three = person.targets["three"]
    again = person.types("robots", "add", "one", three)
    assert again.returncode == 1
    assert "--replace" in only_line(again.stderr)
    assert person.types("robots", "add", "one", person.targets["one"]).returncode == 0, "as it is already"
    assert person.types("robots", "add", "one", three, "--replace").returncode == 0
    assert person.reaches() == "three"


def test_the_file_is_its_owners_alone(person: Person) -> None:
    assert stat.S_IMODE(person.book.stat().st_mode) == 0o600


@pytest.mark.parametrize(
    "words",
    [
        ("robots",),
        ("robots", "add", "three", "three.local"),
        ("robots", "default", "two"),
        ("robots", "remove", "one"),
    ],
)
def test_json_has_exactly_the_documented_keys(person: Person, words: tuple[str, ...]) -> None:
    for line in (("--json", *words), (words[0], "--json", *words[1:]), (*words, "--json")):
        ended = person.types(*line)
        if ended.returncode:  # what was removed can't be removed again
            assert "no robot is called" in only_line(ended.stderr)
            continue
        holds(documented("robots --json"), json.loads(ended.stdout), complete=True)


@pytest.mark.parametrize(
    "words",
    [
        ("status", "--robot", "nobody"),
        ("robots", "remove", "nobody"),
        ("robots", "default", "nobody"),
        ("robots", "add", "two words", "a:1"),
        ("robots", "add", "three", "not an address"),
        ("robots", "add", "three"),
        ("robots", "sideways"),
    ],
)
def test_what_makes_no_sense_is_one_line_and_ends_2(person: Person, words: tuple[str, ...]) -> None:
    ended = person.types(*words)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert only_line(ended.stderr).startswith("error: ")


def test_a_wrong_file_is_one_line_and_hurts_only_who_needs_it(person: Person) -> None:
    person.book.write_text(person.book.read_text() + '\n[robots.three]\ntarget = "a"\npasword = "x"\n')
    for words in (("status",), ("robots",), ("robots", "add", "four", "a:1")):
        ended = person.types(*words)
        assert (ended.returncode, ended.stdout) == (2, "")
        line = only_line(ended.stderr)
        assert f"{person.book}: unknown key 'robots.three.pasword'. Allowed: target, " in line
    assert person.reaches("--target", person.targets["three"]) == "three"


def test_the_credentials_go_with_the_robot(person: Person) -> None:
    kept = person.book.parent / "credentials/one"
    kept.mkdir(parents=True)
    (kept / "token").write_text("secret")
    assert person.types("robots", "remove", "one").returncode == 0
    assert not kept.exists()
