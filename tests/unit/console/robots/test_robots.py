"""The file of known robots, read strictly and edited with its comments kept; and the secrets beside it."""

import os
import stat
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from common.errors import ExitCode, UserError
from common.private_files import write_private
from console.robots import Robot, RobotsFile, choose, read_credentials, read_robots_file
from console.robots.credentials import credentials_directory, forget_credentials
from console.robots.robots_file import parse_robots_file, robots_file_path
from console.robots.robots_file_edit import drop_robot, put_robot, set_default
from tests.support.file_owner import files_belong_to

FULL = """\
# mine
default = "lab2"  # the new one

[robots.lab1]
target = "lab1.local"

# the second floor
[robots.lab2]
target = "10.0.0.2:6000"
ca_certificate_file = "credentials/lab2/ca.pem"
client_certificate_file = "/etc/robots/me.pem"
client_key_file = "~/me.key"
token_file = "credentials/lab2/token"
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robotctl" / "config.toml"


@pytest.fixture
def full(path: Path) -> Path:
    path.parent.mkdir()
    path.write_text(FULL)
    return path


# --- reading ---


def test_a_file_as_values(full: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    content = read_robots_file(full)
    assert content.default == "lab2"
    assert list(content.robots) == ["lab1", "lab2"]
    assert content.robots["lab1"] == Robot(target="lab1.local:50051")
    assert content.robots["lab2"] == Robot(
        target="10.0.0.2:6000",
        ca_certificate_file=full.parent / "credentials/lab2/ca.pem",
        client_certificate_file=Path("/etc/robots/me.pem"),
        client_key_file=Path("/home/someone/me.key"),
        token_file=full.parent / "credentials/lab2/token",
    )


def test_no_file_is_an_empty_book(path: Path) -> None:
    assert read_robots_file(path) == RobotsFile(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("default = ", "not TOML"),
        ("a = " + "[" * 3000, "not TOML"),
        ("a = " + "9" * 5000, "not TOML"),
        ('default = ["lab1"]', "is not one of its robots"),
        ("defualt = 'lab1'", "unknown key 'defualt'. Did you mean 'default'? Allowed: default, robots"),
        (
            "[robots.lab1]\ntarget = 'a'\ntoken = 'x'",
            "unknown key 'robots.lab1.token'. Did you mean 'token_file'? Allowed: ",
        ),
        ("robots = 3", "'robots' is not a table"),
        ("[robots]\nlab1 = 'a:1'", "'robots.lab1' is not a table"),
        ("[robots.lab1]", "robots.lab1 has no target"),
        ("[robots.lab1]\ntarget = 5", "robots.lab1.target = 5 is not a text"),
        ("[robots.lab1]\ntarget = 'a:b:c'", "robots.lab1.target: 'a:b:c' is not the address"),
        ("[robots.lab1]\ntarget = 'a'\ntoken_file = ''", "robots.lab1.token_file = '' is not a text"),
        ("[robots.lab1]\ntarget = 'a'\nclient_key_file = 'k'", "They belong together"),
        ("[robots.'my robot']\ntarget = 'a'", "'my robot' can't be a robot's name"),
        (
            "default = 'lab9'\n[robots.lab1]\ntarget = 'a'",
            "default = 'lab9' is not one of its robots. Known: lab1",
        ),
    ],
)
def test_what_is_wrong_is_one_line_with_the_files_name(path: Path, text: str, says: str) -> None:
    with pytest.raises(UserError) as seen:
        parse_robots_file(path, text)
    line = str(seen.value)
    assert line.startswith(f"{path}: ")
    assert says in line
    assert "\n" not in line
    assert seen.value.exit_code is ExitCode.USAGE


def test_what_can_not_be_read_is_one_line(path: Path) -> None:
    path.mkdir(parents=True)
    with pytest.raises(UserError, match="can't be read: Is a directory"):
        read_robots_file(path)
    path.rmdir()
    path.write_bytes(b"default = '\xff'")
    with pytest.raises(UserError, match="not UTF-8"):
        read_robots_file(path)


def test_where_the_file_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    monkeypatch.setenv("XDG_CONFIG_HOME", "/elsewhere")
    assert robots_file_path() == Path("/elsewhere/robotctl/config.toml")
    for value in ("", "not/absolute"):
        monkeypatch.setenv("XDG_CONFIG_HOME", value)
        assert robots_file_path() == Path("/home/someone/.config/robotctl/config.toml")


# --- which robot is meant ---

KNOWN = parse_robots_file(
    Path("/b"), "default = 'one'\n[robots.one]\ntarget = 'a'\n[robots.two]\ntarget = 'b'\ntoken_file = '/t'"
)
BOTH = {"ROBOTCTL_TARGET": "env:1", "ROBOTCTL_ROBOT": "two"}


@pytest.mark.parametrize(
    ("target", "name", "environment", "meant"),
    [
        ("typed:1", None, BOTH, ("typed:1", None)),
        (None, "two", BOTH, ("b:50051", "two")),
        (None, "one", BOTH, ("a:50051", "one")),
        (None, None, BOTH, ("env:1", None)),
        (None, None, {"ROBOTCTL_ROBOT": "two"}, ("b:50051", "two")),
        (None, None, {}, ("a:50051", "one")),
    ],
)
def test_who_speaks_first(
    target: str | None, name: str | None, environment: dict[str, str], meant: tuple[str, str | None]
) -> None:
    robot, known_as = choose(target, name, environment, lambda: KNOWN)
    assert (robot.target, known_as) == meant


def test_without_anything_it_is_this_computer() -> None:
    assert choose(None, None, {}, lambda: RobotsFile(Path("/b"))) == (Robot(target="127.0.0.1:50051"), None)


def test_robots_without_a_default_do_not_lead_to_this_computer() -> None:
    known = replace(KNOWN, default=None)
    with pytest.raises(UserError, match=r"none of one, two is the default.*robotctl robots default NAME"):
        choose(None, None, {}, lambda: known)
    assert choose(None, None, {"ROBOTCTL_ROBOT": "one"}, lambda: known)[1] == "one"


def test_an_address_beside_a_name_replaces_the_address_alone() -> None:
    assert choose("tunnel:1", "two", {}, lambda: KNOWN)[0] == Robot(target="tunnel:1", token_file=Path("/t"))


def test_a_secret_goes_to_no_address_it_was_not_meant_for() -> None:
    """An address on its own: not even the file is read, broken or not."""

    def read() -> RobotsFile:
        raise AssertionError

    assert choose("typed:1", None, {"ROBOTCTL_ROBOT": "two"}, read)[0] == Robot(target="typed:1")


def test_a_name_with_a_slip() -> None:
    with pytest.raises(UserError, match=r"known: one, two\)\. Did you mean 'two'\?"):
        KNOWN.find("tow")


def test_an_unknown_name() -> None:
    with pytest.raises(UserError, match=r"no robot is called 'three' in /b \(known: one, two\)") as seen:
        choose(None, "three", {}, lambda: KNOWN)
    assert seen.value.exit_code is ExitCode.USAGE


# --- changing ---


def test_the_first_robot_is_the_default(path: Path) -> None:
    put_robot("lab1", Robot(target="lab1.local"), path=path)
    put_robot("lab2", Robot(target="lab2.local"), path=path)
    assert read_robots_file(path).default == "lab1"
    assert path.read_text().splitlines() == [
        'default = "lab1"',
        "",
        "[robots.lab1]",
        'target = "lab1.local:50051"',
        "",
        "[robots.lab2]",
        'target = "lab2.local:50051"',
    ]


def test_only_what_must_change_changes(full: Path) -> None:
    put_robot("lab3", Robot(target="lab3", token_file=full.parent / "t"), path=full)
    assert full.read_text() == FULL + '\n[robots.lab3]\ntarget = "lab3:50051"\ntoken_file = "t"\n'
    drop_robot("lab3", path=full)
    assert full.read_text() == FULL


def test_a_known_robot_is_written_anew_where_it_stands(full: Path) -> None:
    put_robot("lab1", Robot(target="[fe80::1]:1"), path=full)
    assert full.read_text() == FULL.replace('"lab1.local"', '"[fe80::1]:1"')


def test_a_robot_goes_with_its_lines_alone(full: Path) -> None:
    content = drop_robot("lab1", path=full)
    assert content == read_robots_file(full)
    assert full.read_text() == FULL.replace('[robots.lab1]\ntarget = "lab1.local"\n\n', "")
    assert drop_robot("lab2", path=full).default is None
    assert read_robots_file(full).robots == {}


def test_the_default_moves(full: Path) -> None:
    assert set_default("lab1", path=full).default == "lab1"
    assert read_robots_file(full).default == "lab1"
    assert "# mine" in full.read_text()
    with pytest.raises(UserError, match="no robot is called 'lab9'"):
        set_default("lab9", path=full)


@pytest.mark.parametrize("name", ["", "two words", "a.b", "-a", "ü", "a" * 64, "../a", 'a"]'])
def test_a_name_that_would_not_do(path: Path, name: str) -> None:
    with pytest.raises(UserError, match="can't be a robot's name"):
        put_robot(name, Robot(target="a"), path=path)
    assert not path.exists()


@pytest.mark.parametrize("text", ['[robots]\nlab1.target = "a:1"\n', '[robots]\nlab1 = { target = "a:1" }\n'])
def test_other_notations_are_edited_as_well(path: Path, text: str) -> None:
    path.parent.mkdir()
    path.write_text(text)
    put_robot("lab1", Robot(target="b:1"), path=path)
    put_robot("lab2", Robot(target="c:1", token_file=Path("/t")), path=path)
    assert read_robots_file(path).robots == {
        "lab1": Robot(target="b:1"),
        "lab2": Robot(target="c:1", token_file=Path("/t")),
    }
    drop_robot("lab1", path=path)
    assert list(read_robots_file(path).robots) == ["lab2"]


def test_a_notation_that_can_not_be_edited_stays_as_it_is(path: Path) -> None:
    path.parent.mkdir()
    path.write_text(text := 'robots = { lab1 = { target = "a:1" } }\n')
    with pytest.raises(UserError, match="can't change"):
        put_robot("lab2", Robot(target="b:1"), path=path)
    assert path.read_text() == text
    put_robot("lab1", Robot(target="b:1"), path=path)
    assert path.read_text() == text.replace("a:1", "b:1")


def test_comments_behind_values_stay(path: Path) -> None:
    path.parent.mkdir()
    path.write_text(
        '[robots.lab1]\ntarget = "a:1"  # the cable\n\n# about lab2\n[robots.lab2]\ntarget = "b:1"\n'
    )
    put_robot("lab1", Robot(target="c:1", token_file=path.parent / "t"), path=path)
    assert path.read_text() == (
        '[robots.lab1]\ntarget = "c:1"  # the cable\ntoken_file = "t"\n\n'
        '# about lab2\n[robots.lab2]\ntarget = "b:1"\n'
    )


def test_many_at_once_lose_nothing(path: Path) -> None:
    names = [f"lab{number}" for number in range(12)]
    threads = [
        threading.Thread(target=put_robot, args=(name, Robot(target=name)), kwargs={"path": path})
        for name in names
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert sorted(read_robots_file(path).robots) == sorted(names)


def test_a_failed_write_is_reported_and_leaves_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put_robot("lab1", Robot(target="a"), path=path)
    before = path.read_text()

    def full_disk(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(UserError, match="can't be written: No space left on device"):
        put_robot("lab2", Robot(target="b"), path=path)
    assert path.read_text() == before
    assert [file.name for file in path.parent.iterdir()] == ["config.toml"]


def test_a_link_stays_a_link(path: Path, tmp_path: Path) -> None:
    """As people do who keep their settings in a repository."""
    path.parent.mkdir()
    kept = tmp_path / "kept.toml"
    kept.write_text("")
    path.symlink_to(kept)
    put_robot("lab1", Robot(target="a"), path=path)
    assert path.is_symlink()
    assert "lab1" in kept.read_text()


# --- secrets ---


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def secured(full: Path) -> Robot:
    directory = credentials_directory(full, "lab2")
    write_private(directory / "ca.pem", b"CA")
    write_private(directory / "me.pem", b"ME")
    write_private(directory / "me.key", b"KEY")
    write_private(directory / "token", b"abc.DEF-123\n")
    return Robot(
        target="a:1",
        ca_certificate_file=directory / "ca.pem",
        client_certificate_file=directory / "me.pem",
        client_key_file=directory / "me.key",
        token_file=directory / "token",
    )


def test_what_is_written_is_for_its_owner_alone(full: Path) -> None:
    robot = secured(full)
    assert robot.token_file
    assert mode(robot.token_file) == 0o600
    assert mode(robot.token_file.parent) == 0o700
    assert mode(robot.token_file.parent.parent) == 0o700


def test_the_contents_without_secrets_in_the_repr(full: Path) -> None:
    found = read_credentials(secured(full))
    assert (found.ca_certificate, found.client_certificate, found.client_key) == (b"CA", b"ME", b"KEY")
    assert found.token == "abc.DEF-123"
    assert "KEY" not in repr(found)
    assert "abc" not in repr(found)
    assert read_credentials(Robot(target="a:1")).token is None


@pytest.mark.parametrize("rights", [0o640, 0o604, 0o644, 0o660, 0o601, 0o666])
@pytest.mark.parametrize("which", ["token_file", "client_key_file"])
def test_a_secret_that_others_may_touch_is_refused(full: Path, which: str, rights: int) -> None:
    robot = secured(full)
    path: Path = getattr(robot, which)
    path.chmod(rights)
    with pytest.raises(UserError) as seen:
        read_credentials(robot)
    assert str(seen.value).endswith(f"{path} (mode {rights:04o}). Type: chmod 600 {path}")
    assert seen.value.exit_code is ExitCode.USAGE
    path.chmod(0o600)
    read_credentials(robot)


@pytest.mark.parametrize("which", ["token_file", "client_key_file"])
def test_a_secret_of_another_user_is_refused(full: Path, which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """That user may replace it at any time; root may anyway."""
    robot = Robot(target="a:1", **{which: getattr(secured(full), which)})
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    for user in (1000, 0):
        with monkeypatch.context() as patched:
            files_belong_to(user, patched)
            read_credentials(robot)
    files_belong_to(1001, monkeypatch)
    with pytest.raises(UserError, match="belongs to another user") as seen:
        read_credentials(robot)
    assert str(getattr(robot, which)) in seen.value.what
    assert seen.value.exit_code is ExitCode.USAGE


@pytest.mark.parametrize("text", [b"", b"\n", b"two words", b"two\nlines", b"\xff\xfe", b'"quoted"'])
def test_what_is_no_token_is_refused_and_not_repeated(full: Path, text: bytes) -> None:
    robot = secured(full)
    assert robot.token_file
    write_private(robot.token_file, text)
    with pytest.raises(UserError, match="does not hold one token on one line") as seen:
        read_credentials(robot)
    if text.strip():
        assert text.decode(errors="replace") not in str(seen.value)


def test_a_file_that_is_not_there(full: Path) -> None:
    robot = secured(full)
    assert robot.ca_certificate_file
    robot.ca_certificate_file.unlink()
    with pytest.raises(UserError, match=r"CA certificate file .* can't be read: No such file"):
        read_credentials(robot)


def test_what_is_forgotten_is_gone(full: Path) -> None:
    secured(full)
    assert forget_credentials(full, "lab2")
    assert not credentials_directory(full, "lab2").exists()
    assert not forget_credentials(full, "lab2")
