"""What is for a board's processor, built and run here by an emulator: slow, and the same instructions."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import grpc
import pytest
import yaml

from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1 import preview_service_pb2_grpc as pb_grpc
from tests.support.engine import ROOT
from tests.support.free import free_udp_port
from tests.support.gateway_program import gateway_program
from tests.support.running_preview import SMALL
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.gst, pytest.mark.timeout(3600)]

PLATFORM = "linux/arm64"
BASE = "debian:bookworm-slim-arm64"
BUILT_WITHIN_S = 3000
STARTED_WITHIN_S = 300
STAND_IN = "board-encoder-stand-in"
SETTINGS = {
    "source": {"kind": "test"},
    # x264 gets some frames a second through an emulator at this size, and none of 1280x720.
    "profiles": {"balanced": SMALL | {"fps": 3, "bitrate_kbps": 200, "floor_kbps": 100}},
    "encoders": {"order": ["x264"], "probe_timeout_s": 60},
    "timeouts": {
        "start_s": 60,
        "stop_s": 60,
        "source_silence_s": 60,
        "encoder_silence_s": 60,
        "without_gateway_s": 0,
    },
    "runtime_dir": "/tmp/preview",  # the container's own
}
CONSOLE = """
COPY . /tree
WORKDIR /tree
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \\
 && scripts/install-console --without-video
ENTRYPOINT ["/root/.local/bin/robotctl"]
"""


def run(*words: str | Path, cwd: Path = ROOT, within_s: float = 60) -> str:
    ended = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=within_s, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]
    return ended.stdout.strip()


@pytest.fixture(scope="module")
def emulated() -> None:
    """Programs of the other processor run here, and its base image is there."""
    run(ROOT / "docker/emulation", within_s=600)
    run(ROOT / "docker/base-image.sh", "--arch", "arm64", within_s=BUILT_WITHIN_S)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory, emulated: None) -> Path:  # noqa: ARG001  # for its effect
    """This tree, as committed or not, with a package of the board's maker."""
    tree = tmp_path_factory.mktemp("board") / "tree"
    files = run("git", "ls-files", "-co", "--exclude-standard", "-z").split("\0")
    for name in filter(None, files):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    package = tree.parent / STAND_IN
    (package / "DEBIAN").mkdir(parents=True)
    (package / "DEBIAN/control").write_text(
        f"Package: {STAND_IN}\nVersion: 1.0\nArchitecture: arm64\nMaintainer: tests <tests@localhost>\n"
        "Description: stands in for the encoder of a board's maker\n"
    )
    run("dpkg-deb", "--build", "--root-owner-group", package, tree / "docker/vendor")
    return tree


@pytest.fixture(scope="module")
def built(tree: Path) -> Iterator[None]:
    """The images that need no ROS."""
    words = ["scripts/images", "build", "--platform", PLATFORM, "robot-preview", "robot-bridge"]
    run("env", "TAG=test", *words, cwd=tree, within_s=BUILT_WITHIN_S)
    yield
    names = ["robot-preview:test-arm64", "robot-bridge:test-arm64"]
    subprocess.run(["docker", "image", "rm", "--force", *names], capture_output=True, check=False)


@contextmanager
def preview(directory: Path, port: int) -> Iterator[str]:
    """The preview's container; yields its name."""
    directory.chmod(0o777)
    socket = {"socket": "/run/robot-gateway/preview.sock", "srt": {"port": port, "bind": "127.0.0.1"}}
    (directory / "preview.yaml").write_text(yaml.safe_dump(SETTINGS | socket))
    name = f"robot-preview-arm64-{port}"
    run(
        "docker", "run", "--detach", "--name", name, "--platform", PLATFORM, "--network", "host",
        "--volume", f"{directory}:/run/robot-gateway",
        "--env", "ROBOT_PREVIEW_CONFIG=/run/robot-gateway/preview.yaml",
        "robot-preview:test-arm64",
        "robot-preview", "serve", "--config", "/run/robot-gateway/preview.yaml",
    )  # fmt: skip
    try:
        yield name
    finally:
        # Shown if the test fails.
        subprocess.run(["docker", "logs", name], check=False)
        run("docker", "rm", "--force", name)


@pytest.mark.usefixtures("built")
def test_the_images_are_of_that_processor_and_have_the_makers_package() -> None:
    for image in ("robot-preview:test-arm64", "robot-bridge:test-arm64"):
        assert run("docker", "image", "inspect", "--format", "{{.Os}}/{{.Architecture}}", image) == PLATFORM
    listed = run(
        "docker", "run", "--rm", "--platform", PLATFORM, "--network", "none", "--entrypoint", "cat",
        "robot-preview:test-arm64", "/usr/share/robot-gateway-packages.txt",
    )  # fmt: skip
    assert f"{STAND_IN} 1.0" in listed.splitlines()


@pytest.mark.usefixtures("built")
def test_the_preview_does_its_job(tmp_path: Path) -> None:
    """Enabled it encodes, and a viewer here decodes; disabled it ends its listener."""
    port = free_udp_port()
    socket = tmp_path / "preview.sock"
    with preview(tmp_path, port) as name, closing(grpc.insecure_channel(f"unix:{socket}")) as channel:
        wait_until(socket.exists, "the preview serves", STARTED_WITHIN_S)
        stub = pb_grpc.PreviewServiceStub(channel)

        def apply(*, revision: int, enabled: bool) -> None:
            desired = pb.DesiredState(revision=revision, enabled=enabled, profile=pb.PROFILE_BALANCED)
            request = pb.ApplyDesiredStateRequest(desired=desired)
            stub.ApplyDesiredState(request, timeout=STARTED_WITHIN_S, wait_for_ready=True)

        def reaches(state: pb.LifecycleState.ValueType) -> pb.ActualState:
            watch = pb.WatchActualStateRequest()
            for answer in stub.WatchActualState(watch, timeout=STARTED_WITHIN_S):
                assert answer.actual.state != pb.LIFECYCLE_STATE_FAULTED, answer.actual.last_error
                if answer.actual.state == state:
                    return answer.actual
            raise AssertionError("the stream of states has ended")

        apply(revision=1, enabled=True)
        assert reaches(pb.LIFECYCLE_STATE_RUNNING).encoder.name == "x264"
        with Watcher(port) as viewer:
            viewer.wait_for_frames(10)
        apply(revision=2, enabled=False)
        reaches(pb.LIFECYCLE_STATE_DISABLED)
        run("docker", "stop", "--time", "60", name, within_s=90)
        assert run("docker", "inspect", "--format", "{{.State.ExitCode}}", name) == "0"


def checked(name: str) -> "subprocess.CompletedProcess[str]":
    """What a program in its image says of the configuration that is shipped with it."""
    return subprocess.run(
        ["docker", "run", "--rm", "--platform", PLATFORM, "--network", "none",
         "--volume", f"{ROOT}/docker/config/{name}.yaml:/etc/robot-gateway/{name}.yaml:ro",
         f"robot-{name}:test-arm64", f"robot-{name}", "check", "--config", f"/etc/robot-gateway/{name}.yaml"],
        capture_output=True, text=True, timeout=STARTED_WITHIN_S, check=False,
    )  # fmt: skip


@pytest.mark.usefixtures("built")
def test_the_shipped_configurations_are_read() -> None:
    assert checked("preview").returncode == 0
    # Until the robot is enrolled, this is what is missing.
    assert "hub.ca: /etc/robot-bridge/ca.pem" in checked("bridge").stderr


def test_the_console_is_installed_and_calls_a_gateway(tree: Path, tmp_path: Path) -> None:
    dockerfile = tmp_path / "Dockerfile"
    dockerfile.write_text(f"FROM {BASE}\n{CONSOLE}")
    image = "robot-console:test-arm64"
    script = (
        "fail() { exit 1; }; . docker/build-secrets.sh; DOCKER_BUILDKIT=1 docker build --quiet "
        f"--platform {PLATFORM} --secret id=ca,src=$BUILD_CA --secret id=index,src=$BUILD_INDEX "
        f"--tag {image} --file {dockerfile} ."
    )
    (tree / ".dockerignore").unlink()  # It is about the robot's images.
    try:
        run("bash", "-c", script, cwd=tree, within_s=BUILT_WITHIN_S)
        shown = run(
            "docker", "run", "--rm", "--platform", PLATFORM, "--network", "none", image, "--version",
            within_s=STARTED_WITHIN_S,
        )  # fmt: skip
        assert shown.startswith("robotctl ")
        with gateway_program(tmp_path) as gateway:
            status = run(
                "docker", "run", "--rm", "--platform", PLATFORM, "--network", "host", image,
                "--json", "--target", f"127.0.0.1:{gateway.port}", "status",
                within_s=STARTED_WITHIN_S,
            )  # fmt: skip
        assert json.loads(status)["health"]["state"] == "OK"
    finally:
        subprocess.run(["docker", "image", "rm", "--force", image], capture_output=True, check=False)
