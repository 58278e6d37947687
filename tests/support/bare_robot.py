"""A robot without Docker and without a network, made of this machine's own system.

Its directories are others: what is installed on it is on it alone, and goes with the test's directory. ROS 2
is a stand-in that can be imported and nothing else; systemd has not booted, as in the image of an SD card.
`boot` puts a stand-in for systemctl in its place, which notes what is started.
"""

import shlex
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_OWN: Final = ("/opt", "/usr/local/bin", "/usr/local/lib", "/var/lib", "/run")
_ROS: Final = "/opt/ros/jazzy"
_MODULES: Final = (
    *("rclpy", "std_msgs", "std_srvs"),
    *("diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs"),
)
_INSTALL_WITHIN_S: Final = 300
_SYSTEMCTL: Final = """#!/bin/sh
case "$1 $2" in
  "--version ") echo "systemd 252 (252.0-1)" ;;
  "--quiet is-active") grep -qxF "${3%.service}" /run/active ;;
  "--quiet enable" | "daemon-reload " | "reset-failed "*) ;;
  "restart "*)
    shift
    for unit in "$@"; do
      echo "${unit%.service}" >> /run/active
      echo "${unit%.service} $(readlink -e /opt/robot-gateway/current)" >> /run/started
    done ;;
  *) echo "this systemctl does not know: $*" >&2; exit 1 ;;
esac
"""
"""Its active units are the lines of a file, which a test may write, too."""


class BareRobot:
    """A running one.

    Args:
        holder: a process in its namespaces.
    """

    def __init__(self, holder: int) -> None:
        self._enter = ("nsenter", f"--target={holder}", "--mount", "--net", "--")

    def run(self, *command: str | Path) -> "subprocess.CompletedProcess[str]":
        """Runs a command on the robot, as root, with nothing of this process's environment."""
        return subprocess.run(
            [*self._enter, *command],
            cwd="/",
            env={
                "PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
                "HOME": "/root",
                "LC_ALL": "C.UTF-8",
            },
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_INSTALL_WITHIN_S,
            check=False,
        )

    def output(self, *command: str | Path) -> str:
        """Returns what a command prints on standard output."""
        done = self.run(*command)
        assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
        return done.stdout

    def boot(self) -> None:
        """Has scripts/install-robot find a systemd that runs; what it starts is noted, not started."""
        self.write("/usr/local/bin/systemctl", _SYSTEMCTL)
        self.output("chmod", "755", "/usr/local/bin/systemctl")
        self.output("mkdir", "-p", "/run/systemd/system")
        self.output("touch", "/run/active", "/run/started")

    def started(self) -> list[tuple[str, str]]:
        """Returns the units that were started since the last call, in order, each with its release."""
        lines = self.output("cat", "/run/started").splitlines()
        self.write("/run/started", "")
        return [(unit, release) for unit, release in map(str.split, lines)]

    def write(self, path: str | Path, text: str) -> None:
        """Replaces a file's content; its folder has to be there."""
        self.output("sh", "-c", 'printf %s "$2" > "$1"', "sh", path, text)


@contextmanager
def bare_robot(directory: Path) -> Iterator[BareRobot]:
    """Yields one whose own directories are in this directory; needs root, as what is tried on it does."""
    lines = ["set -e"]
    for path in _OWN:
        own = shlex.quote(str(directory / path.strip("/").replace("/", "-")))
        lines += [f"mkdir -p {own}", f"mount --bind {own} {path}"]
    etc = shlex.quote(str(directory / "etc"))
    # Files of other programs may go while it is copied.
    lines += [f"cp -a /etc {etc} || test -e {etc}/passwd", f"mount --bind {etc} /etc", "mkdir /run/lock"]
    lines += [f"mkdir -p {_ROS}/python/{name} && touch {_ROS}/python/{name}/__init__.py" for name in _MODULES]
    # A middleware that can be loaded: some library.
    library = "$(ldconfig -p | awk '$1 == \"libm.so.6\" { print $NF; exit }')"
    lines += [f"mkdir {_ROS}/lib", f"ln -s {library} {_ROS}/lib/librmw_fastrtps_cpp.so"]
    paths = f"PYTHONPATH={_ROS}/python LD_LIBRARY_PATH={_ROS}/lib"
    lines += [f"echo export ROS_DISTRO=jazzy {paths} > {_ROS}/setup.bash"]
    with subprocess.Popen(
        ["unshare", "--mount", "--net", "sh", "-c", "\n".join([*lines, "echo made", "exec cat"])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as holder:
        assert holder.stdin
        assert holder.stdout
        try:
            assert holder.stdout.readline() == "made\n"
            yield BareRobot(holder.pid)
        finally:
            holder.stdin.close()
