import asyncio
import os
import socket
from pathlib import Path
from typing import Any

import pytest

from common.errors import ExitCode, UserError
from simrobot.behaviour import Behaviour
from simrobot.control import ask, ask_base, default_path, listening
from simrobot.robot import Robot
from tests.support.file_owner import files_belong_to


def changes(robot: Robot) -> Any:
    return lambda fields: robot.change(fields, 1.0).model_dump(mode="json")


async def test_a_request_changes_the_robot_and_is_answered(tmp_path: Path) -> None:
    robot = Robot(Behaviour(), 0.0)
    async with listening(tmp_path / "s", changes(robot)):
        answer = await asyncio.to_thread(ask, tmp_path / "s", {"speed_mps": 1.5})
    assert answer["speed_mps"] == 1.5
    assert robot.behaviour.speed_mps == 1.5


async def test_what_the_base_has_heard_is_answered(tmp_path: Path) -> None:
    facts = {"moved_s": 10.0, "zero_s": None}
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0)), lambda: facts):
        assert await asyncio.to_thread(ask_base, tmp_path / "s") == facts
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        assert await asyncio.to_thread(ask_base, tmp_path / "s") is None


async def test_a_refusal_reaches_the_client(tmp_path: Path) -> None:
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        with pytest.raises(UserError, match="silent") as refusal:
            await asyncio.to_thread(ask, tmp_path / "s", {"silent": ["sonar"]})
    assert refusal.value.exit_code is ExitCode.USAGE


@pytest.mark.parametrize("line", [b"{", b"[]", b"7", b"\xff", b'{"speed_mps": NaN}'])
async def test_an_invalid_request_gets_an_error_and_breaks_nothing(tmp_path: Path, line: bytes) -> None:
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        reader, writer = await asyncio.open_unix_connection(tmp_path / "s")
        writer.write(line + b"\n{}\n")
        assert b"error" in await asyncio.wait_for(reader.readline(), 10)
        assert b"behaviour" in await asyncio.wait_for(reader.readline(), 10)
        writer.close()


async def test_only_this_user_may_connect(tmp_path: Path) -> None:
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        assert (tmp_path / "s").stat().st_mode & 0o777 == 0o600
    assert not (tmp_path / "s").exists()


async def test_the_socket_of_a_killed_robot_is_taken_over(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(tmp_path / "s"))
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        assert await asyncio.to_thread(ask, tmp_path / "s", {})


async def test_a_running_robot_keeps_its_socket(tmp_path: Path) -> None:
    async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
        with pytest.raises(UserError, match="another simulated robot"):
            async with listening(tmp_path / "s", changes(Robot(Behaviour(), 0.0))):
                pass
        assert await asyncio.to_thread(ask, tmp_path / "s", {})


def test_a_missing_robot_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no simulated robot answers") as refusal:
        ask(tmp_path / "missing", {})
    assert refusal.value.exit_code is ExitCode.UNREACHABLE
    assert os.linesep not in str(refusal.value)


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The directory for temporary files, of a user without a session."""
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_by_default_it_is_in_a_directory_of_this_users_own(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = default_path()
    assert path == temporary / f"simrobot-{os.getuid()}" / "0.sock"
    assert path.parent.stat().st_mode & 0o7777 == 0o700
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(temporary / "session"))
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert default_path() == temporary / "session" / "simrobot" / "7.sock"


@pytest.mark.parametrize("placed", ["directory", "link"])
def test_what_another_user_has_placed_there_is_not_used(
    temporary: Path, monkeypatch: pytest.MonkeyPatch, placed: str
) -> None:
    """Who listens there would get the requests, and answer them."""
    foreseen = temporary / f"simrobot-{os.getuid()}"
    if placed == "link":
        (temporary / "theirs").mkdir()
        foreseen.symlink_to(temporary / "theirs")
    else:
        foreseen.mkdir()
        files_belong_to(os.geteuid() + 1, monkeypatch)
    with pytest.raises(UserError, match=f"{foreseen} can't be used") as refusal:
        default_path()
    assert "--control" in refusal.value.remedy
