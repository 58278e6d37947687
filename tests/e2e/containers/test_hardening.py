"""Reads the running containers: what a program that was broken into could do there."""

import os
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.containers.deployment import Deployment, mounts, writable

pytestmark = [pytest.mark.docker, pytest.mark.timeout(900)]

SERVICES = ("gateway", "preview", "recorder", "tap", "robot")
USERS = {"gateway": 10001, "preview": 10002, "recorder": 10004, "tap": 10006, "robot": 10001}
GROUP = 10000
WRITABLE = {
    "gateway": {"/tmp", "/dev/shm"},
    "preview": {"/tmp", "/run/robot-gateway", "/run/robot-video", "/dev/shm"},
    "recorder": {"/tmp", "/run/robot-recorder", "/var/lib/robot-recorder", "/dev/shm"},
    "tap": {"/tmp", "/run/robot-tap", "/dev/shm"},
    "robot": {"/tmp", "/dev/shm"},
}
_ON_THE_DISK = {"/var/lib/robot-recorder"}
"""The others are in memory, with options of their own."""
_LISTENING = "0A"


def fields_of_a_running(pid: int) -> dict[str, str] | None:
    """Those of its status; None if it has ended since it was listed, as each health check does soon."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return status_fields(pid)
    return None


def status_fields(pid: int) -> dict[str, str]:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}


@pytest.fixture
def running(demo: Deployment) -> Deployment:
    """With a pipeline at work."""
    with demo.client() as robot:
        robot.enable_preview()
    return demo


@pytest.mark.parametrize("service", SERVICES)
def test_every_process_is_an_ordinary_user_without_privileges(running: Deployment, service: str) -> None:
    processes = [found for pid in running.pids(service) if (found := fields_of_a_running(pid))]
    assert processes
    for fields in processes:
        assert set(fields["Uid"].split()) == {str(USERS[service])}
        assert set(fields["Gid"].split()) == {str(GROUP)}
        for kind in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"):
            assert int(fields[kind], 16) == 0, f"{service}: {kind} {fields[kind]}"
        assert fields["NoNewPrivs"] == "1"
        assert fields["Seccomp"] == "2", "the engine's system call filter is on"


@pytest.mark.parametrize("service", SERVICES)
def test_nothing_can_be_written_beyond_what_is_declared(running: Deployment, service: str) -> None:
    pid = running.program_pid(service)
    assert writable(pid) == WRITABLE[service]
    mounted = mounts(pid)
    assert "ro" in mounted["/"]
    for path in WRITABLE[service] - {"/dev/shm"} - _ON_THE_DISK:
        assert {"noexec", "nosuid", "nodev"} <= mounted[path], path


@pytest.mark.parametrize("service", SERVICES)
def test_temporary_files_are_the_programs_own(running: Deployment, service: str) -> None:
    found = Path(f"/proc/{running.program_pid(service)}/root/tmp").stat()
    assert (found.st_mode & 0o7777, found.st_uid, found.st_gid) == (0o700, USERS[service], GROUP)


def test_the_gateway_cannot_write_where_the_preview_listens(running: Deployment) -> None:
    tried = running.run("exec", "gateway", "touch", "/run/robot-gateway/other.sock", check=False)
    assert tried.returncode != 0
    assert "Read-only file system" in tried.stderr


def test_the_preview_cannot_write_where_the_tap_listens(running: Deployment) -> None:
    tried = running.run("exec", "preview", "touch", "/run/robot-tap/other.sock", check=False)
    assert tried.returncode != 0
    assert "Read-only file system" in tried.stderr


def test_the_socket_is_for_the_two_alone(running: Deployment) -> None:
    directory = Path(f"/proc/{running.program_pid('preview')}/root/run/robot-gateway")
    assert (directory.stat().st_mode & 0o777, directory.stat().st_uid) == (0o750, USERS["preview"])
    socket = (directory / "preview.sock").stat()
    assert (socket.st_mode & 0o777, socket.st_uid, socket.st_gid) == (0o660, USERS["preview"], GROUP)


def listening_tcp(pid: int) -> set[int]:
    """Ports of TCP listeners in a process's network; the engine's own name server is left out."""
    ports = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            fields = line.split()
            address, _, port = fields[1].partition(":")
            if fields[3] == _LISTENING and address != _engine_dns():
                ports.add(int(port, 16))
    return ports


def _engine_dns() -> str:
    """127.0.0.11 as /proc writes it."""
    return "0B00007F"


def test_only_the_declared_ports_listen(running: Deployment) -> None:
    assert listening_tcp(running.program_pid("gateway")) == {50051}
    assert listening_tcp(running.program_pid("preview")) == set()
    assert listening_tcp(running.program_pid("recorder")) == set()
    assert listening_tcp(running.program_pid("tap")) == set()
    assert listening_tcp(running.program_pid("robot")) == set()
    udp = Path(f"/proc/{running.program_pid('preview')}/net/udp").read_text(encoding="ascii").splitlines()[1:]
    bound = {line.split()[1] for line in udp if not line.split()[1].startswith(_engine_dns())}
    assert {int(one.partition(":")[2], 16) for one in bound} == {running.preview_port}


def test_the_images_have_no_compiler_and_no_installer(running: Deployment) -> None:
    for service in ("gateway", "preview", "recorder", "tap"):
        for tool in ("gcc", "cc", "g++", "cmake", "pip", "uv"):
            found = running.run("exec", service, "sh", "-c", f"command -v {tool}", check=False)
            assert found.returncode, f"{service} has {tool}: {found.stdout}"


@pytest.mark.parametrize(
    ("service", "cpus", "processes"),
    [("preview", 1.5, 256), ("recorder", 1.0, 128), ("tap", 1.0, 128)],
    ids=str,
)
def test_limits_are_in_force(running: Deployment, service: str, cpus: float, processes: int) -> None:
    limits = running.inspect(service)["HostConfig"]
    assert (limits["Memory"], limits["PidsLimit"]) == (512 << 20, processes)
    assert limits["NanoCpus"] == min(cpus, os.cpu_count() or 1) * 1e9
    assert limits["CpuShares"] == 256
    score = Path(f"/proc/{running.program_pid(service)}/oom_score_adj").read_text(encoding="ascii")
    assert int(score) == 500
