"""The commands of the compose files exist, with the options that they are given. Needs no engine."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.main import get_command

from bridge.cli import app as bridge_app
from drive.cli import app as drive_app
from gateway.cli import app as gateway_app
from hub.cli import app as hub_app
from preview.cli import app as preview_app
from recorder.cli import app as recorder_app
from simrobot.cli import app as simrobot_app
from tap.cli import app as tap_app

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


def commands() -> list[Any]:
    """The command line of each service, with its entry point where the file has one."""
    found = []
    for file in FILES:
        document = yaml.load((ROOT / file).read_text(encoding="utf-8"), Loader)  # noqa: S506  # a SafeLoader
        for name, service in document["services"].items():
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
