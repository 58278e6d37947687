"""Which transports Fast DDS is given. tests/integration/drive/test_transport.py has it make use of them."""

import os
from pathlib import Path

import pytest

from common.errors import UserError
from drive.transport import use_udp

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
