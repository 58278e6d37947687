"""Paths of sockets that no program can use are mistakes of the configuration, of whichever program."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from pydantic import BaseModel

from common import bind
from common.config import Settings, load
from gateway.config import GatewaySettings
from tap.config import TapSettings
from tests.support.program_settings import PROGRAMS, refusal_of


def sockets_of(model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    """The keys of sockets, by their name, whatever their type checks."""
    for name, field in model.model_fields.items():
        annotation = field.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from ((name, *inner) for inner in sockets_of(annotation))
        elif name == "socket":
            yield (name,)


SOCKETS: Final = [
    pytest.param(program, keys, id=f"{program.__name__}-{'.'.join(keys)}")
    for program in PROGRAMS
    for keys in sockets_of(program)
]


@pytest.mark.parametrize(("program", "keys"), SOCKETS)
@pytest.mark.parametrize(
    ("path", "words"),
    [
        # Two bytes for each letter: bytes count.
        pytest.param("/" + "ä" * 54, "a path of at most 107 bytes; this one has 109", id="long"),
        pytest.param("", "the path of a socket", id="empty"),
        pytest.param("/", "the path of a socket", id="root"),
        pytest.param("/run/a\0b", "the path of a socket", id="NUL"),
    ],
)
def test_a_path_that_no_program_can_use_is_refused(
    tmp_path: Path, program: type[Settings], keys: tuple[str, ...], path: str, words: str
) -> None:
    what = refusal_of(program, keys, path, tmp_path / "x.yaml")
    assert f", line 1: key '{'.'.join(keys)}' is " in what
    assert f"expected: {words}" in what


def test_every_program_has_one() -> None:
    """The test above finds them in the models: this one fails where it finds too few."""
    assert {parameter.values[0] for parameter in SOCKETS} == set(PROGRAMS)
    assert set(sockets_of(GatewaySettings)) == {
        (section, "socket") for section in ("grpc", "preview", "teleop", "recording", "bridge")
    }


def test_the_longest_path_that_is_accepted_can_be_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    longest = Path("x" * 107)
    file = tmp_path / "tap.yaml"
    file.write_text(f"socket: {longest}", encoding="utf-8")
    with bind.stream_socket(load(TapSettings, file).socket):
        assert longest.is_socket()
