"""The commands of the compose files exist, with the options that they are given. Needs no engine.

And what the documents have one type of compose: its files, profiles and services.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.main import get_command

from bridge.cli import app as bridge_app
from drive.cli import app as drive_app
from gateway.cli import app as gateway_app
from gateway.credentials_cli import app as credentials_app
from hub.cli import app as hub_app
from preview.cli import app as preview_app
from recorder.cli import app as recorder_app
from simrobot.cli import app as simrobot_app
from tap.cli import app as tap_app
from tests.support.documented_commands import typed

ROOT = Path(__file__).parents[2]
PROGRAMS = {
    "robot-gateway": gateway_app,
    "robot-preview": preview_app,
    "robot-drive": drive_app,
    "robot-recorder": recorder_app,
    "robot-bridge": bridge_app,
    "robot-tap": tap_app,
    "simrobot": simrobot_app,
}
FILES = (
    *sorted(path.name for path in ROOT.glob("compose*.yaml")),
    *sorted(f"deploy/hub/{path.name}" for path in (ROOT / "deploy/hub").glob("compose*.yaml")),
)


class Loader(yaml.SafeLoader):
    """Reads compose's own tags, !reset and !override, as what they are put before."""


def _plain(loader: Any, _suffix: str, node: Any) -> Any:
    if isinstance(node, yaml.ScalarNode):
        return loader.construct_scalar(node)
    construct = loader.construct_sequence if isinstance(node, yaml.SequenceNode) else loader.construct_mapping
    return construct(node, deep=True)


Loader.add_multi_constructor("!", _plain)


@cache
def services(file: str) -> dict[str, Any]:
    """The services of a compose file, without those that it extends."""
    document = yaml.load((ROOT / file).read_text(encoding="utf-8"), Loader)  # noqa: S506  # a SafeLoader
    found: dict[str, Any] = document["services"]
    return found


def commands() -> list[Any]:
    """The command line of each service, with its entry point where the file has one."""
    found = []
    for file in FILES:
        for name, service in services(file).items():
            words = [*service.get("entrypoint", ()), *service.get("command", ())]
            words = words[words.index("--") + 1 :] if words[:1] == ["tini"] else words
            words = words[3:] if words[:3] == ["python", "-m", "common.guard"] else words
            if words:
                found.append(pytest.param(words, id=f"{file} {name}"))
    return found


def parsed(command: Any, words: list[str]) -> None:
    """Parses a command line; raises Typer's usage error. Groups have no options of their own here."""
    name, *rest = words
    inner = getattr(command, "commands", None)
    if inner is None:
        command.make_context(name, rest)
    else:
        assert rest, f"{name} needs a command"
        assert rest[0] in inner, f"{name} has no command {rest[0]}"
        parsed(inner[rest[0]], rest)


@pytest.mark.parametrize("words", commands())
def test_a_service_starts_a_command_that_exists(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_HUB_SERVERS", "tls://hub.example:4222")
    program, *rest = words
    if words[:2] == ["robot-bridge", "hub"]:
        parsed(get_command(hub_app), rest)
    else:
        parsed(get_command(PROGRAMS[program]), words)


def test_an_option_that_does_not_exist_is_found() -> None:
    with pytest.raises(Exception, match="No such option"):
        parsed(get_command(hub_app), ["hub", "exporter", "--config", "x"])


OF_THE_BUILD = {"ALLOW_STAND_INS", "BUILD_CA", "BUILD_INDEX", "REVISION", "ROS", "VERSION"}
"""Variables that scripts/images sets, or has options for."""
OF_TESTS = {"COMPOSE_PROJECT_NAME"}


def test_the_example_of_settings_lists_what_the_robots_files_read() -> None:
    read: set[str] = set()
    for file in ROOT.glob("compose*.yaml"):
        if file.name != "compose.demo.yaml":
            read |= set(re.findall(r"\$\{([A-Z_]+)", file.read_text(encoding="utf-8")))
    listed = re.findall(r"^#?([A-Z_]+)=", (ROOT / "docker/example.env").read_text("utf-8"), re.MULTILINE)
    # Those two are compose's own.
    assert set(listed) - {"COMPOSE_FILE", "COMPOSE_PROFILES"} == read - OF_THE_BUILD - OF_TESTS
    assert len(listed) == len(set(listed))


PAGES = sorted(path.relative_to(ROOT) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
HISTORY = Path("CHANGELOG.md")
COMPOSE = re.compile(r"docker compose ([^|;&<>()]*)")
OF_ONE_SERVICE = {"run", "exec"}
"""What follows the service is a command of its own."""
OF_SERVICES = {"up", "logs", "kill", "build", "start", "stop", "restart"}
OF_ALL = {"config", "down", "ps", "version"}
ENTRY_POINTS = {"credentials": credentials_app, "admin": hub_app}
"""Services that pass on the words that they are run with."""


def problems(line: str) -> Iterator[str]:
    """Yields what of a line's calls of compose does not exist."""
    known = [(name, service) for file in FILES for name, service in services(file).items()]
    profiles = {profile for _, service in known for profile in service.get("profiles", ())}
    for call in COMPOSE.findall(line):
        words = call.split()
        while words and words[0] in ("-f", "--profile"):
            option, value = words.pop(0), words.pop(0)
            if value not in (FILES if option == "-f" else profiles):
                yield f"there is no {value} for {option}"
        if not words:
            continue
        name = words.pop(0)
        if name not in OF_ONE_SERVICE | OF_SERVICES | OF_ALL:
            yield f"{name}: this test does not know it"
        while words and words[0].startswith("-"):
            words.pop(0)
        named = words[:1] if name in OF_ONE_SERVICE else words if name in OF_SERVICES else []
        yield from (f"there is no service {each}" for each in named if each not in dict(known))
        if name == "run" and words[1:] and words[0] in ENTRY_POINTS:
            group: Any = get_command(ENTRY_POINTS[words[0]])
            if words[1] not in group.commands:
                yield f"{words[0]} has no command {words[1]}"


@pytest.mark.parametrize("page", [page for page in PAGES if page != HISTORY], ids=str)
def test_what_a_page_has_compose_do_exists(page: Path) -> None:
    assert [problem for line in typed(str(page)) for problem in problems(line)] == []


@pytest.mark.parametrize(
    "line",
    [
        "docker compose -f compose.demos.yaml up -d",
        "docker compose --profile drives up -d",
        "docker compose exec gatway robot-gateway doctor",
        "docker compose logs gateway previw | grep x",
        "docker compose run --rm -T credentials ad anna --role operator",
        "docker compose -f deploy/hub/compose.three.yaml run --rm admin enrol lab1",
        "docker compose stat gateway",
    ],
)
def test_what_does_not_exist_is_found(line: str) -> None:
    assert list(problems(line))
