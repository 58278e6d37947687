"""Storing a login, also where it is interrupted."""

import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from common.errors import UserError
from console.client import Credentials
from console.robots import Robot, read_credentials, read_robots_file
from console.robots.login import keep_login, parse_login
from console.robots.robots_file import FILE_KEYS
from console.robots.robots_file_edit import put_robot

TOKEN = Credentials(ca_certificate=b"CA", token="abc.DEF-123")
OTHER_TOKEN = Credentials(ca_certificate=b"ANOTHER CA", token="xyz.GHI-456")
CERTIFICATE = Credentials(ca_certificate=b"THIRD CA", client_certificate=b"ME", client_key=b"KEY")
MOST_STEPS = 64


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robotctl" / "config.toml"


def files_of(name: str, path: Path) -> set[Path]:
    return set((path.parent / "credentials" / name).iterdir())


@pytest.mark.parametrize("credentials", [TOKEN, CERTIFICATE], ids=["token", "certificate"])
def test_a_login_is_read_as_it_was_stored(path: Path, credentials: Credentials) -> None:
    known = keep_login("lab1", "a:1", credentials, path)
    assert known == read_robots_file(path)
    assert read_credentials(known.find("lab1")) == credentials


def test_who_a_login_is_for_holds_no_control_character() -> None:
    text = (
        "# Robot Gateway login 1\nname: anna\x1b]0;owned\x07\nrole: admin\u202e\ntoken: a\nauthority:\nCA\n"
    )
    login = parse_login(text)
    assert (login.name, login.role) == ("anna ]0;owned ", "admin ")


def test_another_kind_of_login_leaves_nothing_of_the_one_before(path: Path) -> None:
    keep_login("lab1", "a:1", CERTIFICATE, path)
    keep_login("lab1", "a:1", TOKEN, path)
    assert read_credentials(read_robots_file(path).find("lab1")) == TOKEN
    kinds = {file.name.partition("-")[0] for file in files_of("lab1", path)}
    assert (kinds, len(files_of("lab1", path))) == ({"ca", "token"}, 2)


def test_of_an_earlier_release_no_secret_is_left_and_what_a_person_put_there_stays(path: Path) -> None:
    directory = keep_login("lab1", "a:1", TOKEN, path).path.parent / "credentials/lab1"
    kept = {directory / "notes.txt", directory / "token.old"}
    for file in (*kept, *(directory / name for name in ("ca.pem", "client.pem", "client-key.pem", "token"))):
        file.write_text("of before")
    keep_login("lab1", "a:1", OTHER_TOKEN, path)
    assert {file for file in files_of("lab1", path) if file.read_text() == "of before"} == kept


class Interrupted:
    """Ends a login at one of its changes of the disk, all of which are renames and deletions.

    Args:
        step: how many of them it completes.
        killed: whether it makes no further one, as a program that is killed; else what it cleans up, it does.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, step: int, *, killed: bool) -> None:
        self._left, self._killed, self.reached = step, killed, False
        for name in ("replace", "unlink"):
            monkeypatch.setattr(Path, name, self._before(getattr(Path, name)))

    def _before(self, change: Callable[..., Any]) -> Callable[..., Any]:
        def changed(*arguments: Any, **options: Any) -> Any:
            if self._left == 0 and (self._killed or not self.reached):
                self.reached = True
                raise KeyboardInterrupt
            self._left = max(0, self._left - 1)
            return change(*arguments, **options)

        return changed


@pytest.mark.parametrize("killed", [False, True], ids=["interrupted", "killed"])
@pytest.mark.parametrize(
    ("before", "after"),
    [(None, TOKEN), (TOKEN, OTHER_TOKEN), (CERTIFICATE, TOKEN), (TOKEN, CERTIFICATE)],
    ids=["new", "token", "certificate to token", "token to certificate"],
)
def test_an_interrupted_login_leaves_the_old_one_whole_or_the_new_one(
    path: Path, before: Credentials | None, after: Credentials, killed: bool
) -> None:
    """Wherever it is interrupted; the entry decides which."""
    seen = []
    for step in range(MOST_STEPS):
        shutil.rmtree(path.parent, ignore_errors=True)
        if before:
            keep_login("lab1", "a:1", before, path)
        with pytest.MonkeyPatch.context() as patched:
            interrupted = Interrupted(patched, step, killed=killed)
            with suppress(KeyboardInterrupt):
                keep_login("lab1", "b:1", after, path)
        robots = read_robots_file(path).robots
        found = [(robot.target, read_credentials(robot)) for robot in robots.values()]
        assert found in ([("a:1", before)] if before else [], [("b:1", after)])
        seen.append(found)
        # Whatever it left behind, the next one deletes.
        robot = keep_login("lab1", "c:1", after, path).find("lab1")
        assert read_credentials(robot) == after
        assert files_of("lab1", path) == {file for key in FILE_KEYS if (file := getattr(robot, key))}
        if not interrupted.reached:
            break
    assert not interrupted.reached, "and it has an end"
    assert seen[0] != seen[-1], "it was interrupted before and after"


def test_a_file_that_another_robot_uses_as_well_stays(path: Path) -> None:
    """As a person may have written it."""
    robot = keep_login("lab1", "a:1", TOKEN, path).find("lab1")
    put_robot("lab2", replace(robot, target="b:1"), path=path)
    keep_login("lab1", "a:1", OTHER_TOKEN, path)
    known = read_robots_file(path)
    assert read_credentials(known.find("lab1")) == OTHER_TOKEN
    assert read_credentials(known.find("lab2")) == TOKEN


@pytest.mark.parametrize(("name", "target"), [("a.b", "a:1"), ("lab1", "a:b"), ("lab2", "a:1")])
def test_where_the_entry_can_not_be_written_no_secret_is(path: Path, name: str, target: str) -> None:
    path.parent.mkdir()
    path.write_text('robots = { lab1 = { target = "a:1" } }\n')
    with pytest.raises(UserError):
        keep_login(name, target, TOKEN, path)
    assert [file.name for file in path.parent.iterdir()] == ["config.toml"]


def test_a_robot_added_before_keeps_its_place(path: Path) -> None:
    put_robot("lab1", Robot(target="a:1"), path=path)
    put_robot("lab2", Robot(target="b:1"), path=path)
    assert list(keep_login("lab1", "c:1", TOKEN, path).robots) == ["lab1", "lab2"]
