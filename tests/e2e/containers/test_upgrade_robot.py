"""scripts/upgrade-robot with small images: what it refuses, what it keeps, and how it goes back.

The project is a stand-in for the robot's: a service with a health check, its configuration check, a volume.
"""

import gzip
import os
import signal
import subprocess
import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from release_program.sums import write_sums

from tests.support.engine import ROOT
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(300)]

COMPOSE = """
name: ${COMPOSE_PROJECT_NAME}
services:
  gateway-config:
    image: robot-gateway:${TAG:-latest}
    pull_policy: never
    network_mode: none
    command: [grep, -q, "^good", /config]
    volumes: ["./docker/config/gateway.yaml:/config:ro"]
  gateway:
    image: robot-gateway:${TAG:-latest}
    pull_policy: never
    network_mode: none
    init: true
    depends_on:
      gateway-config: {condition: service_completed_successfully}
    command: [sh, -c, "cat /name >> /state/log; exec sleep 600"]
    volumes: ["state:/state"]
    healthcheck: {test: [CMD, test, -f, /healthy], interval: 1s, retries: 1}
  extra:
    image: robot-gateway:${TAG:-latest}
    pull_policy: never
    network_mode: none
    init: true
    profiles: [extra]
    command: [sleep, "600"]
volumes:
  state:
# VERSION
"""
DROPPED = """
  dropped:
    image: robot-gateway:${TAG:-latest}
    pull_policy: never
    network_mode: none
    init: true
    command: [sleep, "600"]
"""
"""A service that a release has no more."""
DOCKERFILE = """
FROM debian:bookworm-slim AS whole
RUN programs="/bin/sh /bin/cat /bin/grep /bin/sleep /bin/touch /usr/bin/test" && mkdir /small && \\
    cp -L --parents $programs $(ldd $programs | grep -o '/lib[^ ]*' | sort -u) /small
FROM scratch
COPY --from=whole /small /
"""
"""Only what the services run: a whole system takes seconds to be saved, verified and loaded, in each test."""

NOT_HEALTHY_S = 10
"""After which a version counts as not healthy. The one before, which starts then, has as long."""


class Robot:
    """A robot's directory with a running project, and releases for it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory / "robot"
        self.releases = directory / "releases"
        self.project = f"upgrade-{os.getpid()}-{directory.name[-12:].strip('_-').lower()}"
        self.tags: set[str] = set()

    def begin(self, tag: str = "1.0.0") -> None:
        """Makes the directory, with a changed configuration, and starts version 1.0.0."""
        self.image(tag, "1.0.0")
        self.write_tree(self.directory, "1.0.0")
        (self.directory / ".env").write_text(f"COMPOSE_PROJECT_NAME={self.project}\nTAG={tag}\nOWN=1\n")
        (self.directory / "docker/config/gateway.yaml").write_text("good, this robot's own\n")
        (self.directory / "docker/vendor/board.deb").write_text("a package of the board's maker")
        (self.directory / "notes.txt").write_text("mine")
        self.compose("up", "--detach")

    def image(self, tag: str, version: str, *, healthy: bool = True, revision: str = "") -> None:
        state = " && touch /healthy" if healthy else ""
        dockerfile = (
            f"{DOCKERFILE}RUN echo {version} > /name{state}\n"
            f"LABEL org.opencontainers.image.revision={revision or version}\n"
        )
        subprocess.run(
            ["docker", "build", "--quiet", "--network=none", "--tag", f"robot-gateway:{tag}", "-"],
            input=dockerfile, capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        self.tags.add(tag)

    def write_tree(self, target: Path, version: str) -> None:
        for folder in ("docker/config", "docker/vendor", "scripts"):
            (target / folder).mkdir(parents=True)
        (target / "compose.yaml").write_text(COMPOSE.replace("# VERSION", f"# {version}"))
        (target / "docker/config/gateway.yaml").write_text("the release's default, no good here\n")
        (target / "docker/vendor/README.md").write_text(version)
        (target / f"scripts/of-{version}").write_text("")
        (target / ".dockerignore").write_text(version)

    def foreign_image(self, tag: str, platform: str) -> None:
        """An image for another processor, in which no program has to run to make it."""
        context = self.releases / "context"
        context.mkdir()
        (context / "name").write_text(tag)
        dockerfile = f"FROM scratch\nCOPY name /\nLABEL org.opencontainers.image.revision={tag}\n"
        options = ["--platform", platform, "--tag", f"robot-gateway:{tag}", "--file", "-"]
        subprocess.run(
            ["docker", "build", "--quiet", "--network=none", *options, context],
            input=dockerfile, capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        self.tags.add(tag)

    def tags_of_images(self) -> set[str]:
        listed = subprocess.run(
            ["docker", "image", "ls", "--format", "{{.Tag}}", "robot-gateway"],
            capture_output=True, text=True, timeout=30, check=True,
        ).stdout.split()  # fmt: skip
        return self.tags & set(listed)

    def release(
        self, version: str, *, healthy: bool = True, revision: str = "", platform: str = "", tag: str = ""
    ) -> Path:
        """A release as scripts/release makes it, with these images; without a tag, as it made them once."""
        made, named = self.releases / version, f"TAG={tag}\n" if tag else ""
        tag = tag or version
        (made / "images").mkdir(parents=True)
        if platform:
            self.foreign_image(tag, platform)
        else:
            self.image(tag, version, healthy=healthy, revision=revision)
        saved = subprocess.run(
            ["docker", "save", f"robot-gateway:{tag}"], capture_output=True, timeout=120, check=True
        ).stdout
        with gzip.open(made / f"images/robot-images-{tag}.tar.gz", "wb", compresslevel=1) as file:
            file.write(saved)
        (made / "images/IMAGES").write_text(f"robot-gateway:{tag} sha256:0\n")
        self.write_tree(made / "tree", version)
        with tarfile.open(made / f"robot-gateway-{version}.tar.gz", "w:gz") as file:
            file.add(made / "tree", f"robot-gateway-{version}")
        subprocess.run(["rm", "-r", made / "tree"], check=True)
        (made / "RELEASE").write_text(f"VERSION={version}\nREVISION={version}\n{named}")
        write_sums(made)
        # As on a robot that has never seen it.
        subprocess.run(["docker", "image", "rm", f"robot-gateway:{tag}"], capture_output=True, check=True)
        return made

    def compose(self, *words: str) -> str:
        done = subprocess.run(
            ["docker", "compose", "--progress", "quiet", *words],
            cwd=self.directory, capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        return done.stdout

    def upgrade(self, *words: str | Path, within_s: int = 60) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [ROOT / "scripts/upgrade-robot", "--robot", self.directory, *words],
            cwd="/",
            env={**os.environ, "UPGRADE_HEALTHY_WITHIN_S": str(within_s)},
            capture_output=True, text=True, timeout=200, check=False,
        )  # fmt: skip

    def services(self) -> set[str]:
        """Those that run."""
        listed = subprocess.run(
            ["docker", "ps", "--filter", f"label=com.docker.compose.project={self.project}",
             "--format", '{{.Label "com.docker.compose.service"}}'],
            capture_output=True, text=True, timeout=30, check=True,
        )  # fmt: skip
        return set(listed.stdout.split())

    def started(self) -> list[str]:
        """The versions that ever started, from the volume that outlives them."""
        return self.compose("exec", "-T", "gateway", "cat", "/state/log").split()

    def running(self, service: str = "gateway") -> str:
        """The version that a service runs."""
        return self.compose("--profile", "*", "exec", "-T", service, "cat", "/name").strip()

    def snapshot(self) -> dict[str, str]:
        """All files but the script's own."""
        return {
            str(path.relative_to(self.directory)): path.read_text()
            for path in self.directory.rglob("*")
            if path.is_file() and ".upgrade" not in path.parts
        }

    def end(self) -> None:
        subprocess.run(
            ["docker", "compose", "--profile", "*", "down", "--remove-orphans", "--volumes",
             "--timeout", "1"],
            cwd=self.directory, capture_output=True, timeout=120, check=False,
        )  # fmt: skip
        self.tags.add("before-9.1.0")
        if names := [f"robot-gateway:{tag}" for tag in self.tags_of_images()]:
            subprocess.run(["docker", "image", "rm", "--force", *names], capture_output=True, check=True)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    found = Robot(tmp_path)
    try:
        yield found
    finally:
        found.end()


def test_up_and_back_and_forth_with_state_and_settings_kept(robot: Robot) -> None:
    robot.begin()
    before = robot.snapshot()
    upgraded = robot.upgrade(robot.release("9.1.0"))
    assert upgraded.returncode == 0, upgraded.stderr
    assert upgraded.stderr.splitlines()[-1] == (
        "upgrade-robot: 9.1.0 is in use. Back to 1.0.0: scripts/upgrade-robot --rollback"
    )
    assert robot.running() == "9.1.0"
    assert robot.started() == ["1.0.0", "9.1.0"]
    after = robot.snapshot()
    assert after[".env"] == f"COMPOSE_PROJECT_NAME={robot.project}\nOWN=1\nTAG=9.1.0\n"
    for kept in ("docker/config/gateway.yaml", "docker/vendor/board.deb", "notes.txt"):
        assert after[kept] == before[kept]
    assert "# 9.1.0" in after["compose.yaml"]
    assert (after[".dockerignore"], after["docker/vendor/README.md"]) == ("9.1.0", "9.1.0")
    assert {"scripts/of-9.1.0"} == {name for name in after if name.startswith("scripts/")}

    again = robot.upgrade(robot.releases / "9.1.0")
    assert (again.returncode, again.stderr) == (0, "upgrade-robot: 9.1.0 is in use here already\n")

    back = robot.upgrade("--rollback")
    assert back.returncode == 0, back.stderr
    assert robot.running() == "1.0.0"
    rest = robot.snapshot()
    assert {**rest, ".env": ""} == {**before, ".env": ""}
    assert sorted(rest[".env"].split()) == sorted(before[".env"].split())

    forth = robot.upgrade("--rollback")
    assert forth.returncode == 0, forth.stderr
    assert robot.started() == ["1.0.0", "9.1.0", "1.0.0", "9.1.0"]
    assert robot.snapshot() == after


def test_the_images_of_a_release_have_the_tag_that_it_names(robot: Robot) -> None:
    """As those for another processor than that of the computer that made it."""
    robot.begin()
    upgraded = robot.upgrade(robot.release("9.1.0", tag="9.1.0-arm64"))
    assert upgraded.returncode == 0, upgraded.stderr
    assert "9.1.0-arm64 is in use. Back to 1.0.0" in upgraded.stderr
    assert robot.running() == "9.1.0"
    assert "TAG=9.1.0-arm64\n" in (robot.directory / ".env").read_text()
    assert "is in use here already" in robot.upgrade(robot.releases / "9.1.0").stderr
    assert robot.upgrade("--rollback").returncode == 0
    assert robot.running() == "1.0.0"


@pytest.mark.parametrize("tag", ["latest", "latest-arm64"])
def test_a_tag_that_moves_is_fixed_for_the_way_back(robot: Robot, tag: str) -> None:
    """Back is what ran: neither what was built since, nor what was built before and never started."""
    robot.begin(tag=tag)
    if tag == "latest":
        (robot.directory / ".env").write_text(f"COMPOSE_PROJECT_NAME={robot.project}\n")
    robot.image(tag, "never-started")
    assert robot.upgrade(robot.release("9.1.0")).returncode == 0
    robot.image(tag, "built-since")
    back = robot.upgrade("--rollback")
    assert back.returncode == 0, back.stderr
    assert robot.running() == "1.0.0"


def test_the_settings_stay_their_owners_and_a_link_stays_one(robot: Robot) -> None:
    """The defect: after an upgrade with sudo they were root's, and their owner could not read them."""
    robot.begin()
    settings, own = robot.directory / ".env", robot.directory.parent / "own.env"
    settings.rename(own)
    settings.symlink_to(own)
    own.chmod(0o640)
    os.chown(own, 12345, 12346)
    assert robot.upgrade(robot.release("9.1.0")).returncode == 0
    assert settings.readlink() == own
    assert "TAG=9.1.0" in own.read_text()
    found = own.stat()
    assert (found.st_uid, found.st_gid, found.st_mode & 0o777) == (12345, 12346, 0o640)


def test_a_service_that_was_started_by_hand_comes_along(robot: Robot) -> None:
    robot.begin()
    robot.compose("--profile", "extra", "up", "--detach")
    upgraded = robot.upgrade(robot.release("9.1.0"))
    assert upgraded.returncode == 0, upgraded.stderr
    assert robot.running("extra") == "9.1.0"


def with_more_services(robot: Robot) -> None:
    """Has version 1.0.0 run one that no release has, and beside it one that is the robot's own."""
    robot.begin()
    compose = robot.directory / "compose.yaml"
    compose.write_text(COMPOSE.replace("volumes:\n  state:", f"{DROPPED}volumes:\n  state:"))
    own = robot.directory / "own.yaml"
    own.write_text("services:" + DROPPED.replace("dropped", "own"))
    robot.compose("--file", "compose.yaml", "--file", own.name, "up", "--detach")
    assert robot.services() == {"gateway", "dropped", "own"}


def test_a_service_that_the_release_does_not_have_is_removed(robot: Robot) -> None:
    with_more_services(robot)
    upgraded = robot.upgrade(robot.release("9.1.0"))
    assert upgraded.returncode == 0, upgraded.stderr
    assert robot.services() == {"gateway", "own"}
    back = robot.upgrade("--rollback")
    assert back.returncode == 0, back.stderr
    assert robot.services() == {"gateway", "dropped", "own"}


def test_it_runs_again_where_the_release_does_not_become_healthy(robot: Robot) -> None:
    with_more_services(robot)
    failed = robot.upgrade(robot.release("9.1.0", healthy=False), within_s=NOT_HEALTHY_S)
    assert "1.0.0 is in use again, as before" in failed.stderr
    assert robot.services() == {"gateway", "dropped", "own"}


def test_only_what_runs_and_the_way_back_take_room(robot: Robot) -> None:
    """The defect: images of every version stayed, until a disk was full and no release could be loaded."""
    robot.begin()
    first, second = robot.release("9.1.0"), robot.release("9.2.0")
    assert robot.upgrade(first).returncode == 0
    assert robot.tags_of_images() == {"1.0.0", "9.1.0"}
    upgraded = robot.upgrade(second)
    assert upgraded.returncode == 0, upgraded.stderr
    assert robot.tags_of_images() == {"9.1.0", "9.2.0"}
    assert [each.name for each in (robot.directory / ".upgrade/trees").iterdir()] == ["9.1.0"]
    assert robot.upgrade("--rollback").returncode == 0
    assert robot.running() == "9.1.0"
    assert robot.tags_of_images() == {"9.1.0", "9.2.0"}


def test_a_release_that_does_not_become_healthy_is_left_by_itself(robot: Robot) -> None:
    robot.begin()
    before = robot.snapshot()
    failed = robot.upgrade(robot.release("9.1.0", healthy=False), within_s=NOT_HEALTHY_S)
    assert failed.returncode == 1
    assert "9.1.0 does not become healthy: going back to 1.0.0" in failed.stderr
    assert "1.0.0 is in use again, as before" in failed.stderr
    assert robot.running() == "1.0.0"
    assert {**robot.snapshot(), ".env": ""} == {**before, ".env": ""}
    nothing = robot.upgrade("--rollback")
    assert "there is nothing to go back to" in nothing.stderr


def test_a_configuration_that_the_release_refuses_changes_nothing(robot: Robot) -> None:
    robot.begin()
    (robot.directory / "docker/config/gateway.yaml").write_text("bad\n")
    before = robot.snapshot()
    refused = robot.upgrade(robot.release("9.1.0"))
    assert refused.returncode == 1
    assert (
        "9.1.0 does not accept this robot's configuration of gateway, nothing was changed" in refused.stderr
    )
    assert robot.snapshot() == before
    assert robot.started() == ["1.0.0"]


@pytest.mark.parametrize(
    "damaged", ["images/robot-images-9.1.0.tar.gz", "robot-gateway-9.1.0.tar.gz", "RELEASE"]
)
def test_a_damaged_release_changes_nothing(robot: Robot, damaged: str) -> None:
    robot.begin()
    before = robot.snapshot()
    made = robot.release("9.1.0")
    with (made / damaged).open("ab") as file:
        file.write(b"\n")
    refused = robot.upgrade(made)
    assert refused.returncode == 1
    assert f"{damaged}: FAILED" in refused.stderr
    assert "is damaged or incomplete, nothing was changed" in refused.stderr
    assert robot.snapshot() == before
    assert robot.running() == "1.0.0"


def test_images_of_another_commit_are_refused(robot: Robot) -> None:
    robot.begin()
    refused = robot.upgrade(robot.release("9.1.0", revision="other"))
    assert refused.returncode == 1
    assert "is of commit other, the release of 9.1.0; nothing was changed" in refused.stderr
    assert robot.running() == "1.0.0"


def test_images_of_another_processor_are_refused(robot: Robot) -> None:
    """Docker would start them, and each program would end with "exec format error"."""
    robot.begin()
    own = subprocess.run(
        ["docker", "version", "--format", "{{.Server.Os}}/{{.Server.Arch}}"],
        capture_output=True, text=True, timeout=30, check=True,
    ).stdout.strip()  # fmt: skip
    other = "linux/amd64" if own == "linux/arm64" else "linux/arm64"
    before = robot.snapshot()
    refused = robot.upgrade(robot.release("9.1.0", platform=other))
    assert refused.returncode == 1
    assert (
        f"robot-gateway:9.1.0 is for {other}, and this robot is {own}; nothing was changed" in refused.stderr
    )
    assert robot.snapshot() == before
    assert robot.running() == "1.0.0"


def test_an_upgrade_that_was_killed_is_finished_by_the_next_command(robot: Robot) -> None:
    """While the new containers start: directory and .env are half way or beyond."""
    robot.begin()
    made = robot.release("9.1.0", healthy=False)
    program = subprocess.Popen(
        [ROOT / "scripts/upgrade-robot", "--robot", robot.directory, made],
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    marker = robot.directory / ".upgrade/switching"
    try:
        wait_until(marker.exists, "the upgrade has begun to switch", 60)
    finally:
        os.killpg(program.pid, signal.SIGKILL)
        program.wait(10)
    assert marker.read_text() == "9.1.0 1.0.0\n"
    finished = robot.upgrade("--rollback", within_s=NOT_HEALTHY_S)
    assert "a change from 1.0.0 to 9.1.0 was interrupted: finishing it" in finished.stderr
    assert "1.0.0 is in use again" in finished.stderr
    assert robot.running() == "1.0.0"
    assert not marker.exists()


def test_an_upgrade_that_was_killed_between_two_renames_is_finished(robot: Robot) -> None:
    """The directory has then no such file: neither the old one nor the new one."""
    robot.begin()
    assert robot.upgrade(robot.release("9.1.0")).returncode == 0
    own = robot.snapshot()
    for name in ("compose.yaml", "docker", ".dockerignore"):
        (robot.directory / ".upgrade/switching").write_text("1.0.0 9.1.0\n")
        aside = robot.directory / ".upgrade/trees/9.1.0"
        aside.mkdir()
        (robot.directory / name).rename(aside / name)
        finished = robot.upgrade("--rollback")
        assert "a change from 9.1.0 to 1.0.0 was interrupted: finishing it" in finished.stderr, name
        # The rollback that was asked for leads forth again.
        assert finished.returncode == 0, f"{name}: {finished.stderr}"
        assert robot.running() == "9.1.0", name
        assert robot.snapshot() == own, name


def test_an_upgrade_that_was_killed_before_it_said_what_it_changes_is_no_obstacle(robot: Robot) -> None:
    robot.begin()
    (robot.directory / ".upgrade").mkdir()
    (robot.directory / ".upgrade/switching").touch()
    assert robot.upgrade(robot.release("9.1.0")).returncode == 0
    assert robot.running() == "9.1.0"
    assert not (robot.directory / ".upgrade/switching").exists()


def test_two_at_a_time_are_refused(robot: Robot) -> None:
    robot.begin()
    (robot.directory / ".upgrade").mkdir()
    with subprocess.Popen(
        ["flock", robot.directory / ".upgrade/lock", "cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdin
        assert holder.stdout
        holder.stdin.write(b"held\n")
        holder.stdin.flush()
        assert holder.stdout.readline() == b"held\n"
        refused = robot.upgrade("--rollback")
        holder.stdin.close()
    assert refused.returncode == 1
    assert "another upgrade-robot is at work" in refused.stderr


def test_a_rollback_whose_images_are_gone_changes_nothing(robot: Robot) -> None:
    robot.begin()
    assert robot.upgrade(robot.release("9.1.0")).returncode == 0
    subprocess.run(
        ["docker", "image", "rm", "--force", "robot-gateway:1.0.0"], capture_output=True, check=True
    )
    refused = robot.upgrade("--rollback")
    assert refused.returncode == 1
    assert "the image robot-gateway:1.0.0 is gone, nothing was changed" in refused.stderr
    assert robot.running() == "9.1.0"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "one argument"),
        (("--forward",), "unknown: --forward"),
        (("/nowhere",), "there is no directory /nowhere"),
        (("/usr",), "/usr is no release"),
        (("--rollback",), "there is nothing to go back to"),
    ],
)
def test_what_is_no_command_is_refused(robot: Robot, words: tuple[str, ...], said: str) -> None:
    robot.write_tree(robot.directory, "1.0.0")
    refused = robot.upgrade(*words)
    assert refused.returncode in (1, 2)
    assert said in refused.stderr
