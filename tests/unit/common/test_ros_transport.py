"""Which transports Fast DDS is given. tests/integration/drive/test_transport.py has it make use of them."""

import os
from pathlib import Path

import pytest

from common.errors import UserError
from common.ros_transport import VARIABLE, chosen_transport, use_udp

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name in (RANGE, TRANSPORTS, PROFILES):
        monkeypatch.setenv(name, "")
    return monkeypatch


def seen() -> tuple[str | None, ...]:
    return tuple(os.environ.get(name) for name in (RANGE, TRANSPORTS, PROFILES))


def test_a_range_beyond_this_machine_needs_no_profiles(tmp_path: Path) -> None:
    use_udp(tmp_path)
    assert seen() == ("", "UDPv4", "")
    assert list(tmp_path.iterdir()) == []


def test_the_range_localhost_is_made_of_profiles(tmp_path: Path, environment: pytest.MonkeyPatch) -> None:
    environment.setenv(RANGE, "LOCALHOST")
    use_udp(tmp_path)
    assert seen() == ("SYSTEM_DEFAULT", "", str(tmp_path / "fastdds.xml"))
    use_udp(tmp_path / "of-a-child")


@pytest.mark.parametrize("name", [TRANSPORTS, PROFILES])
def test_a_choice_of_others_counts(tmp_path: Path, environment: pytest.MonkeyPatch, name: str) -> None:
    environment.setenv(RANGE, "LOCALHOST")
    environment.setenv(name, "theirs")
    before = seen()
    use_udp(tmp_path)
    assert seen() == before


def test_a_directory_that_is_not_writable_is_named(tmp_path: Path, environment: pytest.MonkeyPatch) -> None:
    environment.setenv(RANGE, "LOCALHOST")
    with pytest.raises(UserError, match=r"fastdds.xml can't be written \(No such file or directory\)"):
        use_udp(tmp_path / "missing")


def test_the_environment_chooses_it_for_as_long_as_a_node_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "UDP ")
    monkeypatch.setenv(RANGE, "LOCALHOST")
    with chosen_transport():
        profiles = Path(os.environ[PROFILES])
        assert "UDPv4" in profiles.read_text(encoding="utf-8")
        assert os.environ[RANGE] == "SYSTEM_DEFAULT"
    assert not profiles.exists()
    assert not os.environ[PROFILES]
    assert os.environ[RANGE] == "LOCALHOST"


def test_without_a_choice_nothing_is_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    before = dict(os.environ)
    with chosen_transport():
        assert dict(os.environ) == before


def test_a_transport_that_does_not_exist_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "shm")
    with pytest.raises(UserError, match="ROBOT_ROS_TRANSPORT is 'shm'"), chosen_transport():
        pass
