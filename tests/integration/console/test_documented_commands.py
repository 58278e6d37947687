"""Every block of commands of the documents that can run, as a reader pastes it, against a real robot."""

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.documented_commands import PAGES, ROOT, Block, blocks
from tests.support.free import free_tcp_port
from tests.support.robotctl import environment
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until

BIN = Path(sys.executable).parent
ADDRESSES = re.compile(r"\b(?:ROBOT:50051|lab1\.local|lab2\.local:50051|10\.0\.0\.2:50051)")
"""The robots of the documents."""
ENDLESS = re.compile(r"\brobotctl (?=watch|view --headless --record)")
"""What a reader ends with Ctrl-C."""
INTERRUPTED = f"{sys.executable} {ROOT}/tests/support/interrupted.py robotctl "
DONE_ELSEWHERE = re.compile(r"(?<!continuous integration) do(es)?\b")
"""A reason that says that something else runs the block."""
PROGRAM = re.compile(
    r"(?<!\S)(?:[\w.-]*/)*(robotctl|robot-[a-z]+|scripts/[\w-]+)(?!\S)(?: (?!robot-)([a-z][a-z-]*))?"
)
ENDS_WITHIN_S = 120

pytestmark = [pytest.mark.gst, pytest.mark.timeout(300)]


class Reader:
    """A person with a home, who types a page's blocks one after the other."""

    def __init__(self, home: Path, target: str) -> None:
        self.home = home
        (home / ".config").mkdir(exist_ok=True)
        self.target = target
        self.extra: dict[str, str] = {}

    def types(self, block: Block) -> None:
        text = ADDRESSES.sub(self.target, block.text)
        text = ENDLESS.sub(INTERRUPTED, text)
        own = {
            "HOME": str(self.home),
            "XDG_CONFIG_HOME": str(self.home / ".config"),
            "PATH": f"{BIN}:{os.environ['PATH']}",
        }
        ended = subprocess.run(
            ["bash", "-e", "-u", "-o", "pipefail", "-c", text],
            cwd=self.home,
            env=environment(**own, **self.extra),
            capture_output=True,
            text=True,
            timeout=ENDS_WITHIN_S,
            check=False,
        )
        assert ended.returncode == 0, f"{block.name}\n{text}\n{ended.stdout}\n{ended.stderr}"


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VideoGround]:
    with video_ground(tmp_path_factory.mktemp("robot")) as ground:
        yield ground


def runnable(page: str) -> list[Block]:
    return [block for block in blocks(page) if not block.reason]


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page not in ("docs/security.md", "docs/client.md")]
)
def test_the_commands_of_a_page_work_in_their_order(robot: VideoGround, tmp_path: Path, page: str) -> None:
    reader = Reader(tmp_path, robot.target)
    (tmp_path / "docker").symlink_to(ROOT / "docker")
    if page not in ("README.md", "docs/robotctl.md"):
        # Where no robot is named, the documents' one is at the default address. Those two add it to the
        # known robots, which this outranks.
        reader.extra = {"ROBOTCTL_TARGET": robot.target}
    found = runnable(page)
    assert found
    for block in found:
        reader.types(block)


def test_the_way_to_a_guarded_gateway(tmp_path: Path) -> None:
    """docs/security.md: what is typed on the robot, then on the laptop."""
    port = free_tcp_port()
    reader = Reader(tmp_path, f"127.0.0.1:{port}")
    init, add, login = runnable("docs/security.md")
    reader.types(init)
    config = tmp_path / "gateway.yaml"
    security = {"credentials": str(tmp_path / "credentials")}
    config.write_text(json.dumps({"sources": [], "grpc": {"port": port}, "security": security}))
    reader.extra = {"ROBOT_GATEWAY_CONFIG": str(config)}
    reader.types(add)
    serve: list[str | Path] = [BIN / "robot-gateway", "serve", "--config", str(config)]
    with subprocess.Popen(serve, stderr=subprocess.DEVNULL) as gateway:
        try:
            wait_until(lambda: listens(port), "the gateway listens", 30)
            reader.types(login)
        finally:
            gateway.terminate()


def listens(port: int) -> bool:
    """Whether a program does; without a bind, which would keep it out at that moment."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_every_block_is_run_or_says_why_not() -> None:
    assert {page for page in PAGES if any(True for _ in blocks(page))} == set(PAGES)
    for page in PAGES:
        for block in blocks(page):
            assert block.reason == "" or len(block.reason) > 10, block.name
            tests = re.findall(r"tests/[\w/.]+", block.reason)
            for test in tests:
                assert (ROOT / test).exists(), f"{block.name}: {test}"
            assert tests or not DONE_ELSEWHERE.search(block.reason), f"{block.name}: which test does?"
            text = text_of(tests)
            missing = [word for word in typed(block) if word not in text] if tests else []
            assert missing == [], f"{block.name}: {tests} do no such thing"


def typed(block: Block) -> Iterator[str]:
    """The project's programs of a block, and their commands as a test types them: in quotes."""
    for line in block.text.splitlines():
        for program, command in PROGRAM.findall(line.partition("#")[0]):
            yield program
            if command:
                yield f'"{command}"'


def text_of(tests: list[str]) -> str:
    """The text of files, and of those in folders."""
    paths = [path for test in tests for path in (ROOT / test, *(ROOT / test).rglob("*.py"))]
    return "".join(path.read_text(encoding="utf-8") for path in paths if path.is_file())


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_valid_for_a_shell(page: str) -> None:
    for block in blocks(page):
        if "synopsis" not in block.reason:
            checked = subprocess.run(
                ["bash", "-n", "-c", block.text], capture_output=True, text=True, check=False
            )
            assert checked.returncode == 0, f"{block.name}: {checked.stderr}"
