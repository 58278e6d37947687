"""A robot without Docker: a container whose first process is systemd, with the programs as its units."""

import json
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import pytest

from tests.support.engine import ROOT
from tests.support.waiting import wait_until

IMAGE: Final = "robot-gateway-systemd"
_CAPABLE: Final = (
    *(f"--cap-add={name}" for name in ("SYS_ADMIN", "SYS_NICE", "SYS_PTRACE")),
    *(f"--security-opt={name}=unconfined" for name in ("apparmor", "seccomp", "systempaths")),
)
"""For control groups, mounts and namespaces; less than --privileged, which not every engine can give."""
_BOOT: Final = (
    "mount -o remount,rw /sys/fs/cgroup 2> /dev/null; exec /lib/systemd/systemd --show-status=false"
)
_ENGINE_REFUSED: Final = 125
"""Exit code of docker run when the engine could not start the container."""
_BUILD_WITHIN_S: Final = 1500
_BOOT_WITHIN_S: Final = 90
_COMMAND_WITHIN_S: Final = 120


class SystemdRobot:
    """A running one.

    Args:
        enter: the command that runs another one on it, as root, with its standard input.
    """

    def __init__(self, enter: Sequence[str]) -> None:
        self._enter = tuple(enter)

    def run(
        self, *command: str, check: bool = True, within_s: float = _COMMAND_WITHIN_S
    ) -> "subprocess.CompletedProcess[str]":
        """Runs a command on the robot, as root."""
        done = subprocess.run(
            [*self._enter, *command],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=within_s,
            check=False,
        )
        assert not check or done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-4000:]}"
        return done

    def output(self, *command: str) -> str:
        """Returns what a command prints on standard output."""
        return self.run(*command).stdout

    def write(self, path: str, text: str) -> None:
        """Writes a file."""
        subprocess.run(
            [*self._enter, "tee", path],
            input=text,
            text=True,
            stdout=subprocess.DEVNULL,
            timeout=_COMMAND_WITHIN_S,
            check=True,
        )

    def property(self, program: str, name: str) -> str:
        """Returns a property of a program's unit."""
        return self.output("systemctl", "show", "--value", f"--property={name}", f"robot-{program}").strip()

    def pid(self, program: str) -> int:
        """Returns its main process; 0 while there is none."""
        return int(self.property(program, "MainPID"))

    def wait_active(self, program: str, within_s: float = 30) -> None:
        """Waits until the program says that it serves."""
        wait_until(
            lambda: self.property(program, "ActiveState") == "active",
            f"robot-{program} serves: {self.log(program)}",
            within_s,
        )

    def log(self, program: str) -> str:
        """Returns the last lines of its log."""
        return self.run(
            "journalctl", "--no-pager", "--output=cat", "--lines=30", f"--unit=robot-{program}", check=False
        ).stdout

    def status_of(self, pid: int) -> dict[str, str]:
        """Returns the fields of a process's status, proc_pid_status(5)."""
        lines = self.output("cat", f"/proc/{pid}/status").splitlines()
        return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}

    def robotctl(self, *arguments: str) -> Any:
        """Returns what robotctl prints as JSON."""
        return json.loads(self.output("/opt/robot-gateway/current/bin/robotctl", *arguments, "--json"))

    def as_user(self, user: str, *command: str) -> "subprocess.CompletedProcess[str]":
        """Runs a command as one of the programs' users, with all of its groups."""
        return self.run(
            "setpriv", f"--reuid={user}", f"--regid={user}", "--init-groups", *command, check=False
        )


def build_image() -> None:
    """Builds the image from this tree; from the build cache where nothing has changed."""
    built = subprocess.run(
        [ROOT / "docker/systemd-robot"], capture_output=True, text=True, timeout=_BUILD_WITHIN_S, check=False
    )
    assert built.returncode == 0, f"docker/systemd-robot: {built.stderr[-3000:]}"


@contextmanager
def running_robot(name: str, options: Sequence[str] = ()) -> Iterator[SystemdRobot]:
    """Boots one and yields it when its boot has finished; removes it at the end.

    systemd makes control groups and mounts of its own, for which the container has more capabilities than
    others: what the tests try is how systemd confines the programs in it.
    """
    command = [
        *("docker", "run", "--detach", "--rm", "--name", name, "--network=none"),
        *("--cgroupns=private", "--tmpfs=/run:exec", "--tmpfs=/tmp", *_CAPABLE, *options, IMAGE),
        *("sh", "-c", _BOOT),
    ]  # fmt: skip
    begun = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if begun.returncode == _ENGINE_REFUSED:
        # An engine that lacks a capability itself can't give all of them.
        pytest.skip(f"the engine can't start a container for systemd: {begun.stderr.strip()[-300:]}")
    assert begun.returncode == 0, begun.stderr
    try:
        robot = SystemdRobot(["docker", "exec", "--interactive", name])
        wait_until(
            lambda: (
                robot.run("systemctl", "is-system-running", check=False).stdout.strip()
                in {"running", "degraded"}
            ),
            "systemd has booted",
            _BOOT_WITHIN_S,
        )
        yield robot
    finally:
        subprocess.run(["docker", "rm", "--force", name], capture_output=True, timeout=60, check=False)
