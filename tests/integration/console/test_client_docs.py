"""The examples of docs/client.md, run as they stand against a real gateway."""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from console.client import ClientOptions, Event, GatewayClient, GatewayError, errors
from console.client.results import EventKind
from tests.support.documented_code import DOCS, Example, examples
from tests.support.gateway_program import gateway_program
from tests.support.preview_double import double_process
from tests.support.recorder_double import recorder_process
from tests.support.robotctl import environment

PAGE = (DOCS / "client.md").read_text(encoding="utf-8")
ENDS_WITHIN_S = 60.0


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    directory = tmp_path_factory.mktemp("gateway")
    recorder = directory / "recorder.sock"
    with (
        double_process(directory / "preview.sock"),
        recorder_process(recorder),
        gateway_program(directory, sources=[], recording={"socket": str(recorder)}) as gateway,
    ):
        yield f"127.0.0.1:{gateway.port}"


ALL = examples("client.md")
DRIVING = [example for example in ALL if ".drive(" in example.code]


@pytest.mark.parametrize(
    "example",
    [example for example in ALL if example not in DRIVING],
    ids=lambda example: f"example-{example.number}",
)
def test_an_example_prints_what_it_says(example: Example, target: str, tmp_path: Path) -> None:
    prints_what_it_says(example, target, tmp_path)


@pytest.mark.timeout(300)
@pytest.mark.ros
@pytest.mark.parametrize("example", DRIVING, ids=lambda example: f"example-{example.number}")
def test_an_example_of_driving_moves_a_robot(
    example: Example,
    ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path: Path,
) -> None:
    from tests.support.driven_robot import driven_robot, drives_undisturbed  # noqa: PLC0415  # needs rclpy

    with driven_robot(tmp_path) as robot:

        def attempt() -> None:
            heard = len(robot.base.heard)
            prints_what_it_says(example, robot.target, tmp_path)
            assert any(each.moves for each in robot.base.heard[heard:])
            assert not robot.base.moves

        drives_undisturbed(robot, attempt)


def prints_what_it_says(example: Example, target: str, tmp_path: Path) -> None:
    book = tmp_path / "robotctl/config.toml"
    book.parent.mkdir(exist_ok=True)
    book.write_text(f'[robots.lab2]\ntarget = "{target}"\n')
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-c", example.code.replace("robot.local", target)],
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(XDG_CONFIG_HOME=str(tmp_path)),
        cwd=tmp_path,
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, "")
    assert example.prints, "an example that promises nothing proves nothing"
    rest = ran.stdout
    for promised in example.prints:
        _, found, rest = rest.partition(promised)
        assert found, f"{promised!r} is not in what it printed:\n{ran.stdout}"


def test_every_error_is_in_the_table_with_its_word() -> None:
    family = {
        one.__name__: one.kind
        for one in vars(errors).values()
        if isinstance(one, type) and issubclass(one, GatewayError) and one is not GatewayError
    }
    rows = dict(re.findall(r"^\| `(\w+)`(?:, a `Refused`)? \| `(\w+)` \|", PAGE, re.MULTILINE))
    assert rows == family


def test_the_table_of_events_has_every_kind_and_field() -> None:
    table = PAGE.partition("| `kind` | field | has |")[2].partition("\n\n")[0]
    rows = [
        [re.findall(r"`([\w.]+)`", cell) for cell in line.split("|")[1:4]] for line in table.splitlines()[2:]
    ]
    kinds = [kind.removeprefix("EventKind.") for row in rows for kind in row[0]]
    assert sorted(kinds) == sorted(kind.name for kind in EventKind)
    hints = get_type_hints(Event)
    parts = {field.name: get_args(hints[field.name])[0] for field in fields(Event) if field.default is None}
    rows = [row for row in rows if row[1]]
    assert sorted(name for row in rows for name in row[1]) == sorted(parts)
    for _, (name, *_more), has in rows:
        if is_dataclass(parts[name]):
            assert has == [field.name for field in fields(parts[name])], name


def test_every_option_and_method_is_named() -> None:
    methods = {name for name in vars(GatewayClient) if not name.startswith("_")} - {"close"}
    for name in (*methods, *ClientOptions.__dataclass_fields__):
        assert f"`{name}" in PAGE or f"({name}" in PAGE, name
