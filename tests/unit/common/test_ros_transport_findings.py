"""What the doctors say of shared memory, from files like those that Fast DDS makes."""

import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.findings import Finding, Verdict
from common.ros_transport_findings import transport_finding

FAST_DDS = "rmw_fastrtps_cpp"
OTHER = 1000 if os.geteuid() != 1000 else 1001
PORT_OF_DOMAIN_3 = 7400 + 3 * 250 + 11


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name in ("FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE", "ROBOT_ROS_TRANSPORT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    # Files can be given to another user by root alone: so it is this process that is another one.
    monkeypatch.setattr(os, "geteuid", lambda: OTHER)
    return monkeypatch


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Path]:
    """A node of this domain that runs: it holds the lock of its port."""
    lock = port(tmp_path, PORT_OF_DOMAIN_3)
    with lock.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        yield tmp_path


def port(directory: Path, number: int) -> Path:
    (directory / f"fastrtps_port{number}").touch()
    lock = directory / f"fastrtps_port{number}_el"
    lock.touch()
    return lock


def found(memory: Path, middleware: str = FAST_DDS) -> Finding:
    (finding,) = transport_finding(middleware, memory)
    return finding


def test_a_node_of_another_user_that_cannot_be_heard(node: Path) -> None:
    finding = found(node)
    assert finding.verdict is Verdict.WRONG
    assert f"user {node.stat().st_uid}" in finding.what
    assert "Set ROBOT_ROS_TRANSPORT=udp" in finding.remedy


def test_a_choice_of_shared_memory_has_to_go_as_well(node: Path, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("FASTDDS_BUILTIN_TRANSPORTS", "SHM")
    environment.setenv("ROBOT_ROS_TRANSPORT", "udp")  # Theirs counts.
    assert found(node).remedy.endswith("unset FASTDDS_BUILTIN_TRANSPORTS")


@pytest.mark.parametrize(
    ("name", "value"), [("ROBOT_ROS_TRANSPORT", "UDP "), ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")]
)
def test_over_udp_it_is_heard(node: Path, environment: pytest.MonkeyPatch, name: str, value: str) -> None:
    environment.setenv(name, value)
    assert found(node).verdict is Verdict.GOOD


def test_a_node_of_the_same_user_is_heard(node: Path, environment: pytest.MonkeyPatch) -> None:
    own = node.stat().st_uid
    environment.setattr(os, "geteuid", lambda: own)
    assert found(node).verdict is Verdict.GOOD


def test_what_a_killed_node_has_left_is_no_node(tmp_path: Path) -> None:
    port(tmp_path, PORT_OF_DOMAIN_3)
    (tmp_path / f"fastrtps_port{PORT_OF_DOMAIN_3 + 2}").touch()
    assert found(tmp_path).verdict is Verdict.GOOD


def test_nodes_of_other_domains_do_not_count(node: Path, environment: pytest.MonkeyPatch) -> None:
    for domain in ("2", "4", "many"):
        environment.setenv("ROS_DOMAIN_ID", domain)
        assert found(node).verdict is Verdict.GOOD


def test_what_cannot_be_read_proves_nothing(tmp_path: Path) -> None:
    (tmp_path / f"fastrtps_port{PORT_OF_DOMAIN_3}_el").mkdir()
    (tmp_path / f"fastrtps_port{PORT_OF_DOMAIN_3 + 2}_el").symlink_to(tmp_path / "nowhere")
    assert found(tmp_path).verdict is Verdict.GOOD
    assert found(tmp_path / "missing").verdict is Verdict.GOOD


def test_profiles_of_the_robots_own_are_named(node: Path, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "/robot/profiles.xml")
    assert found(node).verdict is Verdict.NOTE


def test_other_middlewares_have_no_such_memory(node: Path) -> None:
    assert list(transport_finding("rmw_cyclonedds_cpp", node)) == []
