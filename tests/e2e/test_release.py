"""scripts/release: the same bytes from the same commit, installed where no network is."""

import itertools
import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from release_program.sums import write_sums

from tests.support.bare_robot import bare_robot
from tests.support.release import (
    ROOT,
    VERSION,
    alone,
    clone,
    commit,
    git,
    raise_version,
    release,
    released_repository,
)

pytestmark = pytest.mark.timeout(600)

PYTHON = "3.11"
WHEELS = tuple(f"robot_gateway_{name}-{VERSION}-py3-none-any.whl" for name in ("client", "console"))
IMPORT_ALL = """
import importlib, importlib.util, json, sys
for name in json.loads(sys.argv[1]):
    importlib.import_module(name)
    assert sys.modules[name].__file__.startswith(sys.prefix), sys.modules[name].__file__
for absent in json.loads(sys.argv[2]):
    assert importlib.util.find_spec(absent) is None, absent
"""


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return released_repository(tmp_path_factory.mktemp("first"))


@pytest.fixture(scope="module")
def made(repository: Path) -> Path:
    """A release for all Pythons, at the path where it is by default."""
    ended = release(repository, "--without-images")
    assert ended.returncode == 0, ended.stderr
    directory = repository / f"build/robot-gateway-{VERSION}"
    assert ended.stderr.splitlines()[-1] == f"release: {directory}"
    return directory


def sums(directory: Path) -> dict[str, str]:
    lines = (directory / "SHA256SUMS").read_text().splitlines()
    return {path: digest for digest, path in (line.split("  ") for line in lines)}


def modules(wheel: Path) -> list[str]:
    with zipfile.ZipFile(wheel) as file:
        paths = [name.removesuffix(".py") for name in file.namelist() if name.endswith(".py")]
    return sorted(path.removesuffix("/__init__").replace("/", ".") for path in paths)


def fresh_environment(directory: Path, *options: str, python: str | Path = "/usr/bin/python3") -> Path:
    subprocess.run([python, "-m", "venv", *options, directory], check=True, timeout=120)
    return directory / "bin"


def other_python(version: str) -> str:
    """Returns the path of an interpreter of this version, where the machine has one."""
    found = subprocess.run(
        [ROOT / "scripts/test-python", "--find", version],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    if found.returncode != 0:
        pytest.skip(f"no Python {version} is here: {found.stderr.strip()}")
    return found.stdout.strip()


def python_of_releases() -> str:
    """Returns the version of the interpreter that scripts/release installs what it has made with."""
    ask = "import sys; print('%d.%d' % sys.version_info[:2])"
    return subprocess.run(
        ["/usr/bin/python3", "-c", ask], capture_output=True, text=True, timeout=30, check=True
    ).stdout.strip()


def test_two_releases_of_a_commit_are_the_same_bytes(made: Path, repository: Path, tmp_path: Path) -> None:
    """From another clone, at another path, hour and place, and with another umask.

    The second one lacks the other projects' wheels for other Pythons, whose bytes the lock file decides.
    """
    output = tmp_path / "second"
    before = os.umask(0o077)
    try:
        other = clone(repository, tmp_path / "elsewhere")
        ended = release(
            other,
            "--without-images",
            "--python",
            python_of_releases(),
            "--output",
            output,
            environment={"TZ": "Asia/Tokyo", "LC_ALL": "C"},
        )
    finally:
        os.umask(before)
    assert ended.returncode == 0, ended.stderr
    first, second = sums(made), sums(output)
    assert second.items() <= first.items()
    lacking = first.keys() - second.keys()
    assert not [path for path in lacking if not path.endswith(".whl") or "robot_gateway" in path]
    assert len(second) > 25


def test_every_file_is_in_the_sums(made: Path) -> None:
    files = {str(path.relative_to(made)) for path in made.rglob("*") if path.is_file()}
    assert files - {"SHA256SUMS"} == sums(made).keys()
    checked = subprocess.run(
        ["sha256sum", "--check", "--quiet", "--strict", "SHA256SUMS"],
        cwd=made,
        capture_output=True,
        check=False,
    )
    assert (checked.returncode, checked.stdout) == (0, b"")


def test_it_names_its_version_its_commit_and_what_is_new(made: Path, repository: Path) -> None:
    revision = git(repository, "rev-parse", "HEAD").strip()
    assert (made / "RELEASE").read_text() == f"VERSION={VERSION}\nREVISION={revision}\n"
    changes = (made / "CHANGES.md").read_text()
    assert changes.startswith(f"# {VERSION} - 2026-01-02\n\n### Added\n")
    assert "[0.1.0]" not in changes
    assert f"robot-gateway-{VERSION}.tar.gz" in (made / "INSTALL.md").read_text()


def test_the_sbom_lists_what_is_installed_with_licences_and_dependencies(made: Path) -> None:
    boms = {
        name: json.loads((made / f"sbom/robot_gateway_{name}-{VERSION}.cdx.json").read_text())
        for name in ("client", "console")
    }
    for name, bom in boms.items():
        assert (bom["bomFormat"], bom["specVersion"]) == ("CycloneDX", "1.6")
        main = bom["metadata"]["component"]
        assert (main["name"], main["version"]) == (f"robot-gateway-{name}", VERSION)
        assert bom["metadata"]["timestamp"] == "2026-01-02T03:04:05+00:00"
        assert "/tmp" not in json.dumps(bom)  # noqa: S108  # of the computer that made it
        edges = {edge["ref"]: edge.get("dependsOn", []) for edge in bom["dependencies"]}
        assert any(other.startswith("grpcio") for others in edges.values() for other in others)
    listed = {
        name: {component["name"].lower().replace("_", "-"): component for component in bom["components"]}
        for name, bom in boms.items()
    }
    assert {"grpcio", "protobuf", "tomlkit"} <= listed["client"].keys()
    assert not {"pyside6-essentials", "typer", "pip", "setuptools"} & listed["client"].keys()
    assert {"pyside6-essentials", "typer", "nkeys", "robot-gateway-client"} <= listed["console"].keys()
    wheels = {wheel.name.split("-")[0].lower().replace("_", "-") for wheel in (made / "wheels").iterdir()}
    assert listed["console"].keys() - wheels == set()
    assert "Apache-2.0" in json.dumps(listed["client"]["grpcio"]["licenses"])
    robot = json.loads((made / f"sbom/without_docker-{VERSION}.cdx.json").read_text())
    assert {"grpcio", "nkeys", "mcap"} <= {component["name"] for component in robot["components"]}


IMAGE_SBOM = """
import sys
from release_program.image_sbom import debian_components, document, python_components
system = 'NAME="Debian GNU/Linux"\\nID=debian\\nVERSION_ID="12"\\n'
def made():
    debian = debian_components("libc6\\t2.36-9+deb12u1\\tamd64\\tglibc\\n", system)
    python = python_components('[["typing_extensions", "4.16.0"]]')
    return document("robot-gateway", "1.2.3", [*debian, *python], 1767323045)
assert made() == made()
print(made())
list(debian_components("dpkg-query: no packages found\\n", system))
"""


def test_an_images_sbom_is_the_same_each_time_and_lists_nothing_but_packages() -> None:
    """Of listings as an image gives them; tests/e2e/containers has real ones."""
    ended = subprocess.run(
        [ROOT / ".cache/release/bin/python", "-c", IMAGE_SBOM],
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'scripts'}:{ROOT}"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 1
    assert "which is no package" in ended.stderr
    bom = json.loads(ended.stdout)
    assert bom["metadata"]["timestamp"] == "2026-01-02T03:04:05+00:00"
    assert [component["purl"] for component in bom["components"]] == [
        "pkg:deb/debian/libc6@2.36-9%2Bdeb12u1?arch=amd64&distro=debian-12&upstream=glibc",
        "pkg:pypi/typing-extensions@4.16.0",
    ]


def test_the_client_installs_and_imports_without_network_gstreamer_and_qt(made: Path, tmp_path: Path) -> None:
    tools = fresh_environment(tmp_path / "environment")
    installed = alone(
        *(tools / "pip", "install", "--no-index", "--find-links", made / "wheels"),
        f"robot-gateway-client=={VERSION}",
    )
    assert installed.returncode == 0, installed.stderr
    names = modules(made / "wheels" / WHEELS[0])
    assert {"console.client.blocking", "console.robots", "common.errors"} <= set(names)
    tried = alone(
        *(tools / "python", "-c", IMPORT_ALL),
        *(json.dumps(each) for each in (names, ["gi", "PySide6", "typer", "rich", "nats"])),
    )
    assert tried.returncode == 0, tried.stderr
    assert not (tools / "robotctl").exists()


@pytest.mark.parametrize("version", ["3.12", "3.13"])
def test_robotctl_and_the_client_install_on_newer_pythons(made: Path, version: str, tmp_path: Path) -> None:
    """Without network; video needs GStreamer's Python side, which is of the system's Python."""
    tools = fresh_environment(tmp_path / "environment", python=other_python(version))
    installed = alone(
        *(tools / "pip", "install", "--no-index", "--find-links", made / "wheels"),
        f"robot-gateway-console=={VERSION}",
    )
    assert installed.returncode == 0, installed.stderr
    tried = alone(
        *(tools / "python", "-c", IMPORT_ALL),
        *(json.dumps(each) for each in (modules(made / "wheels" / WHEELS[0]), ["gi", "PySide6"])),
    )
    assert tried.returncode == 0, tried.stderr
    assert alone(tools / "robotctl", "--version").stdout.startswith(f"robotctl {VERSION}")
    refused = alone(tools / "robotctl", "--target", "127.0.0.1:1", "status")
    assert refused.returncode == 3
    assert "no robot gateway reached" in refused.stderr


def test_robotctl_installs_and_works_without_network(made: Path, tmp_path: Path) -> None:
    # GStreamer's Python side is Debian's.
    tools = fresh_environment(tmp_path / "environment", "--system-site-packages")
    installed = alone(
        *(tools / "pip", "install", "--ignore-installed", "--no-index", "--find-links", made / "wheels"),
        f"robot-gateway-console[video,gamepad]=={VERSION}",
    )
    assert installed.returncode == 0, installed.stderr
    names = modules(made / "wheels" / WHEELS[1])
    tried = alone(tools / "python", "-c", IMPORT_ALL, json.dumps(names), "[]")
    assert tried.returncode == 0, tried.stderr
    assert alone(tools / "robotctl", "--version").stdout.startswith(f"robotctl {VERSION}")
    shown = alone(tools / "robotctl", "--help")
    assert "monitor" in shown.stdout
    refused = alone(tools / "robotctl", "--target", "127.0.0.1:1", "status")
    assert refused.returncode == 3
    assert "no robot gateway reached" in refused.stderr


def test_install_console_takes_a_release_and_nothing_else(made: Path, tmp_path: Path) -> None:
    subprocess.run(
        ["tar", "-xf", made / f"robot-gateway-{VERSION}.tar.gz", "-C", tmp_path], check=True, timeout=60
    )
    script = tmp_path / f"robot-gateway-{VERSION}/scripts/install-console"
    home = tmp_path / "home"
    home.mkdir()
    ended = alone(script, "--without-video", "--release", made, HOME=str(home), XDG_DATA_HOME="")
    assert ended.returncode == 0, ended.stderr
    link = home / ".local/bin/robotctl"
    assert alone(link, "--version", HOME=str(home)).stdout.startswith(f"robotctl {VERSION}")
    assert not list(link.resolve().parents[1].glob("lib/*/site-packages/PySide6*"))
    again = alone(script, "--release", made, "--without-video", HOME=str(home), XDG_DATA_HOME="")
    assert "up to date" in again.stderr


ROBOTS_OWN = ("grpc", "pydantic", "nats", "nkeys", "mcap", "zstandard", "uvloop", "preview.app", "bridge.app")


def test_a_robot_without_docker_is_installed_without_network(
    made: Path, repository: Path, tmp_path: Path
) -> None:
    """Up to its first boot."""
    archive = made / f"robot-gateway-{VERSION}.tar.gz"
    subprocess.run(["tar", "-xf", archive, "-C", tmp_path], check=True, timeout=60)
    script = tmp_path / f"robot-gateway-{VERSION}/scripts/install-robot"
    (tmp_path / "robot").mkdir()
    with bare_robot(tmp_path / "robot") as robot:
        done = robot.run(script, "--release", made)
        assert done.returncode == 0, done.stderr
        assert "robot-gateway robot-preview start at the next boot" in done.stderr
        current = Path("/opt/robot-gateway/current")
        robot.output(current / "bin/python", "-c", IMPORT_ALL, json.dumps(ROBOTS_OWN), '["PySide6"]')
        revision = git(repository, "rev-parse", "HEAD").strip()
        settings = robot.output("cat", current / "share/robot/gateway.env").splitlines()
        assert f"ROBOT_GATEWAY_REVISION={revision}" in settings
        for program in ("gateway", "preview", "drive", "recorder", "bridge", "tap"):
            robot.output(f"robot-{program}", "check")
        assert robot.run(script, "--release", made).stderr == "install-robot: up to date\n"


LATER = "9.9.0"
LEFT = {
    "/etc/robot-gateway/gateway.yaml": "name: lab7\n",
    "/etc/robot-gateway/robot.env": "ROS_DOMAIN_ID=7\n",
    "/var/lib/robot-gateway/credentials/principals.json": "who may call",
    "/var/lib/robot-gateway/audit/audit.jsonl": "what was done",
    "/var/lib/robot-drive/stop": "a stop",
    "/var/lib/robot-recorder/a/data/000000.mcap": "what was recorded",
    "/var/lib/robot-bridge/outbox": "what waits for the hub",
}
"""What is the robot's own, whatever version runs."""


def of_the_next_version(made: Path, target: Path) -> tuple[Path, Path]:
    """Returns the tree and the release of a later version, which needs the same wheels."""
    tree, later = target / "tree", target / "release"
    tree.mkdir()
    archive = made / f"robot-gateway-{VERSION}.tar.gz"
    subprocess.run(["tar", "-xf", archive, "-C", tree, "--strip-components=1"], check=True, timeout=60)
    raise_version(tree, LATER)
    shutil.copytree(made / "robot", later / "robot", copy_function=os.link)
    (later / "RELEASE").write_text((made / "RELEASE").read_text().replace(VERSION, LATER))
    write_sums(later)
    return tree, later


def test_a_robot_without_docker_is_upgraded_and_taken_back(made: Path, tmp_path: Path) -> None:
    """By two commands, without network, with everything kept that is the robot's own."""
    archive = made / f"robot-gateway-{VERSION}.tar.gz"
    subprocess.run(["tar", "-xf", archive, "-C", tmp_path], check=True, timeout=60)
    first = tmp_path / f"robot-gateway-{VERSION}/scripts/install-robot"
    (tmp_path / "next").mkdir()
    tree, later = of_the_next_version(made, tmp_path / "next")
    script = tree / "scripts/install-robot"
    (tmp_path / "robot").mkdir()
    with bare_robot(tmp_path / "robot") as robot:

        def in_use() -> tuple[str, str]:
            """The release in use, and the version of its programs."""
            release = robot.output("readlink", "-e", "/opt/robot-gateway/current").strip()
            ask = "from common.version import project_version; print(project_version())"
            return release, robot.output(f"{release}/bin/python", "-c", ask).strip()

        def done(*command: str | Path) -> None:
            ended = robot.run(*command)
            assert ended.returncode == 0, ended.stderr

        robot.boot()
        done(first, "--release", made)
        old, version = in_use()
        assert version == VERSION
        assert robot.started() == [("robot-gateway", old), ("robot-preview", old)]
        for path, text in LEFT.items():
            robot.output("mkdir", "-p", Path(path).parent)
            robot.write(path, text)
        # Enabled by hand; and one that someone has stopped.
        robot.write("/run/active", "robot-gateway\nrobot-drive\n")

        done(script, "--release", later)
        new, version = in_use()
        assert version == LATER
        assert robot.started() == [("robot-gateway", new), ("robot-drive", new)]
        done(script, "--rollback")
        assert in_use() == (old, VERSION)
        assert robot.started() == [("robot-gateway", old), ("robot-drive", old)]
        done(script, "--rollback")
        assert in_use() == (new, LATER)
        assert robot.started() == [("robot-gateway", new), ("robot-drive", new)]
        assert {path: robot.output("cat", path) for path in LEFT} == LEFT

        # A setting that the version does not know: what runs, runs on.
        robot.write("/etc/robot-gateway/gateway.yaml", "name: lab7\nno_such_key: 1\n")
        for options in (["--rollback"], ["--release", later]):
            refused = robot.run(script, *options)
            assert refused.returncode == 1
            assert "gateway.yaml, line 2: unknown key 'no_such_key'" in refused.stderr
            assert "what ran before, runs on" in refused.stderr
            assert in_use() == (new, LATER)
            assert robot.started() == []


def test_robots_of_each_python_and_processor_have_their_wheels(made: Path) -> None:
    names = [each.name for each in (made / "robot").iterdir()]
    for python, machine in itertools.product(("cp311", "cp312", "cp313"), ("x86_64", "aarch64")):
        found = [name for name in names if python in name and name.endswith(f"{machine}.whl")]
        assert any(name.startswith("grpcio-") for name in found), (python, machine)


def test_a_damaged_release_is_not_installed_from(made: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)
    with (copy / "wheels" / WHEELS[0]).open("ab") as file:
        file.write(b"x")
    ended = alone(ROOT / "scripts/install-console", "--release", copy, HOME=str(tmp_path), XDG_DATA_HOME="")
    assert ended.returncode == 1
    assert "is damaged or incomplete" in ended.stderr
    assert not (tmp_path / ".local").exists()


@pytest.mark.parametrize("directory", ["nowhere", ""])
def test_what_is_no_release_is_refused(directory: str, tmp_path: Path) -> None:
    ended = alone(
        ROOT / "scripts/install-console",
        "--release",
        tmp_path / directory,
        HOME=str(tmp_path),
        XDG_DATA_HOME="",
    )
    assert ended.returncode == 1
    assert "there is no directory" in ended.stderr or "is no release" in ended.stderr


def test_what_is_not_committed_is_refused_and_nothing_is_made(repository: Path, tmp_path: Path) -> None:
    changed = clone(repository, tmp_path / "changed")
    (changed / "README.md").write_text("changed")
    (changed / "new").write_text("new")
    # Of the robot that the images are for.
    (changed / ".env").write_text("TAG=latest\n")
    ended = release(changed, "--output", tmp_path / "out")
    assert ended.returncode == 1
    assert ended.stderr == f"release: {VERSION} can't be released: not committed: README.md, new\n"
    assert not (tmp_path / "out").exists()


def test_a_release_that_exists_is_not_overwritten(made: Path, repository: Path) -> None:
    before = (made / "SHA256SUMS").stat()
    ended = release(repository)
    assert ended.returncode == 1
    assert f"{made} exists" in ended.stderr
    assert (made / "SHA256SUMS").stat() == before


def test_a_failed_build_names_its_reason_and_leaves_nothing(repository: Path, tmp_path: Path) -> None:
    broken = clone(repository, tmp_path / "broken")
    lock = broken / "requirements/console.txt"
    lock.write_text("typer==0.29.2\n")
    commit(broken)
    ended = release(broken, "--without-images", "--python", PYTHON, "--output", tmp_path / "out/release")
    assert ended.returncode == 1
    assert ended.stderr.endswith("release: the lock file has no hash of typer. Type: scripts/lock\n")
    assert not list((tmp_path / "out").iterdir())
