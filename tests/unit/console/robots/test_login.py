"""Storing a login, also where it is interrupted."""

from pathlib import Path

import pytest

from common.errors import UserError
from common.private_files import write_private
from console.client import Credentials
from console.robots import Robot, read_credentials, read_robots_file, robots_file_edit
from console.robots.login import keep_login, parse_login
from console.robots.robots_file_edit import put_robot

TOKEN = Credentials(ca_certificate=b"CA", token="abc.DEF-123")
CERTIFICATE = Credentials(ca_certificate=b"CA", client_certificate=b"ME", client_key=b"KEY")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robotctl" / "config.toml"


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
    assert {file.name for file in (path.parent / "credentials" / "lab1").iterdir()} == {"ca.pem", "token"}


@pytest.mark.parametrize("completed", range(3))
@pytest.mark.parametrize("known", [False, True], ids=["new", "known"])
def test_an_interrupted_login_leaves_no_entry_without_its_credentials(
    path: Path, monkeypatch: pytest.MonkeyPatch, completed: int, known: bool
) -> None:
    if known:
        keep_login("lab1", "a:1", CERTIFICATE, path)
    writes = [write_private] * completed

    def interrupted(file: Path, content: bytes) -> None:
        if not writes:
            raise KeyboardInterrupt
        writes.pop()(file, content)

    monkeypatch.setattr(robots_file_edit, "write_private", interrupted)
    with pytest.raises(KeyboardInterrupt):
        keep_login("lab1", "b:1", TOKEN, path)
    robots = read_robots_file(path).robots
    assert [robot.target for robot in robots.values()] == (["a:1"] if known else [])
    assert all(read_credentials(robot).ca_certificate for robot in robots.values())


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
