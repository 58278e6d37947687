"""Mistakes in a configuration file: the line, the key, what is there and what is expected."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal, get_args

import pytest
from pydantic import BaseModel, Field, ValidationError
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings, as_yaml, json_schema, load
from common.config_problems import expected, models_in
from common.errors import ExitCode, UserError
from gateway.config import GatewaySettings
from preview.config import PreviewSettings
from tests.support.program_settings import PROGRAMS, file_with, refusal_of


class _Item(Section):
    kind: Literal["a", "b"]
    size: int = Field(default=1, ge=1, le=9)


class _Server(Section):
    host: str = "localhost"
    port: int = 1
    ratio: float = 0.5
    names: tuple[str, ...] = ()


class _Settings(Settings):
    model_config = SettingsConfigDict(env_prefix="TESTED__")

    name: str = Field(default="x", min_length=1, max_length=5)
    enabled: bool = True
    folder: Path = Path("/tmp")  # noqa: S108  # a value
    server: _Server = _Server()
    items: tuple[_Item, ...] = ()
    numbers: Mapping[str, int] = Field(default={})


def mistake(tmp_path: Path, text: str) -> str:
    file = tmp_path / "x.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as raised:
        load(_Settings, file)
    assert raised.value.exit_code is ExitCode.USAGE
    assert "Input should" not in str(raised.value), "that is how pydantic speaks"
    return raised.value.what.removeprefix(f"configuration {file}")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "name: a\nserver:\n  prot: 1",
            ", line 3: unknown key 'server.prot'. Did you mean 'port'? Allowed: ",
        ),
        (
            "nam: a",
            ", line 1: unknown key 'nam'. Did you mean 'name'? Allowed: name, enabled, folder, server",
        ),
        (
            "items:\n- kind: a\n- kind: b\n  sise: 2",
            ", line 4: unknown key 'items.1.sise'. Did you mean 'size'?",
        ),
        ("zzz: 1", ", line 1: unknown key 'zzz'. Allowed: "),
        ("items:\n- size: 2", ", line 2: key 'items.0.kind' is missing"),
        ("items: [{kind: c}]", "key 'items.0.kind' is 'c', expected: one of a, b"),
        ("items: [{kind: a, size: 10}]", "key 'items.0.size' is 10, expected: at most 9"),
        ("items: [{kind: a, size: 0}]", "expected: at least 1"),
        ("items: 3", "key 'items' is 3, expected: a list, [a, b] for example"),
        ("server: 3", "key 'server' is 3, expected: a section of keys and values"),
        ("server: {port: many}", "expected: a whole number"),
        ("server: {port: 1.5}", "expected: a whole number"),
        ("server: {ratio: x}", "expected: a number, 2.5 for example"),
        ("server: {names: a}", "expected: a list, [a, b] for example"),
        ("enabled: perhaps", "expected: true or false"),
        ("name: 5", "expected: a text; write numbers and dates in quotation marks"),
        ("name: ''", "expected: a text that is not empty"),
        ("name: abcdef", "expected: a text of at most 5 characters"),
        ("name: a\nname: b", ", line 2: key 'name' is there twice, first in line 1"),
        ("server:\n  port: 1\n  port: 1", ", line 3: key 'port' is there twice, first in line 2"),
        ("a: [", ", line 1 is not YAML: "),
        ("name: abcdef\nenabled: perhaps", "(and 1 more)"),
    ],
)
def test_a_mistake(tmp_path: Path, text: str, says: str) -> None:
    assert says in mistake(tmp_path, text)


def test_a_merge_key_is_not_a_key_twice(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("items:\n- &one {kind: a, size: 2}\n- <<: *one\n  size: 3\n")
    assert [item.size for item in load(_Settings, file).items] == [2, 3]


def test_a_mistake_in_the_environment_has_no_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TESTED__SERVER__PORT", "many")
    with pytest.raises(UserError) as raised:
        load(_Settings, None)
    assert raised.value.what.startswith("configuration from the environment: key 'server.port' is 'many'")


@pytest.mark.parametrize("variable", ["TESTED__ITEMS", "TESTED__SERVER__NAMES", "TESTED__SERVER"])
def test_a_variable_that_is_no_json_is_one_line(monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    monkeypatch.setenv(variable, "[")
    with pytest.raises(UserError) as raised:
        load(_Settings, None)
    assert str(raised.value).startswith("configuration from the environment: key ")
    assert str(raised.value).endswith('=["a", "b"] for example')


NO_FORM: Final = "\u20ac of no form"
"""Has no form that any setting requires."""
WRONG: Final[tuple[Any, ...]] = (
    None,
    "",
    "x",
    -1,
    0,
    1.5,
    1e99,
    10**30,
    float("nan"),
    True,
    [],
    [1],
    ["x"],
    {},
    {"a": 1},
    "x" * 5000,
    NO_FORM,
)


LIBRARY: Final = re.compile(
    "[Ii]nput should|[Vv]alue error|valid (dict|tuple|string|number|integer)|another value"
)


def keys_of(model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    for name, field in model.model_fields.items():
        yield (name,)
        annotation = field.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from ((name, *inner) for inner in keys_of(annotation))


@pytest.mark.parametrize("settings_type", PROGRAMS)
def test_no_mistake_is_explained_in_the_librarys_words(settings_type: type[Settings], tmp_path: Path) -> None:
    """Whatever is written in place of any value."""
    file = tmp_path / "x.yaml"
    sentences = []
    for keys in keys_of(settings_type):
        for wrong in WRONG:
            values: Any = wrong
            for key in reversed(keys):
                values = {key: values}
            try:
                load(settings_type, file_with(settings_type, values, file))
            except UserError as error:
                sentences.append(error.what)
    assert len(sentences) > (200 if settings_type in (GatewaySettings, PreviewSettings) else 20)
    assert [each for each in sentences if LIBRARY.search(each)] == []


def with_a_form(schema: Mapping[str, Any], text: Any) -> Iterator[Any]:
    """Values of a key by its JSON schema, with the text in each place that requires a form of its texts.

    Sections are left out: they have schemas of their own.
    """
    if "pattern" in schema:
        yield text
    for branch in schema.get("anyOf", ()):
        yield from with_a_form(branch, text)
    if "items" in schema:
        yield from ([inner] for inner in with_a_form(schema["items"], text))
    if "patternProperties" in schema:
        yield {text: {}}
    if isinstance(values := schema.get("additionalProperties"), dict):
        yield from ({"a": inner} for inner in with_a_form(values, text))


def sections_of(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A section and those in it."""
    yield model
    for field in model.model_fields.values():
        for inner in models_in(field.annotation):
            yield from sections_of(inner)


def test_a_text_of_another_form_is_explained_by_an_example() -> None:
    """In all programs: the models say which keys require a form."""
    explained = {}
    for section in {each for program in PROGRAMS for each in sections_of(program)}:
        for key, schema in section.model_json_schema()["properties"].items():
            for value in with_a_form(schema, NO_FORM):
                with pytest.raises(ValidationError) as raised:
                    section.model_validate({key: value})
                (problem,) = (each for each in raised.value.errors() if each["input"] == NO_FORM)
                explained[f"{section.__name__}.{key}"] = expected(problem)
    assert {"PreviewSettings.cameras", "HubSettings.servers", "MuxOutput.topic"} <= explained.keys()
    assert {
        key: says
        for key, says in explained.items()
        if LIBRARY.search(says) or not re.search("for example|such as", says)
    } == {}


def leaves_of(model: type[BaseModel]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The keys that hold no section, with what they take."""
    for name, field in model.model_fields.items():
        annotation = field.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from (((field.alias or name, *inner), kind) for inner, kind in leaves_of(annotation))
        else:
            yield (field.alias or name,), annotation


@pytest.mark.parametrize("settings_type", PROGRAMS)
def test_true_is_no_number_and_no_number_is_true(settings_type: type[Settings], tmp_path: Path) -> None:
    """Also where it equals the default: True == 1, and False == 0."""
    checked = 0
    for keys, kind in leaves_of(settings_type):
        of_union = {kind, *get_args(kind)}
        if of_union & {int, float} and bool not in of_union:
            for value in (True, False):
                says = refusal_of(settings_type, keys, value, tmp_path / "x.yaml")
                assert f"key '{'.'.join(keys)}' is {str(value).lower()}, expected: a " in says
                checked += 1
        elif bool in of_union:
            for number in (0, 1, 1.0):
                says = refusal_of(settings_type, keys, number, tmp_path / "x.yaml")
                assert f"key '{'.'.join(keys)}' is {number}, expected: true or false" in says
                checked += 1
    assert checked > 1


def test_a_section_that_equals_its_default_is_checked(tmp_path: Path) -> None:
    assert mistake(tmp_path, "server: {port: true}") == (
        ", line 1: key 'server.port' is true, expected: a whole number"
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name: a\nserver:\n  ratio: no", ", line 3: key 'server.ratio' is false, expected: a number, 2.5"),
        ("enabled: 1", ", line 1: key 'enabled' is 1, expected: true or false"),
        ("items:\n- kind: a\n- {kind: b, size: yes}", ", line 3: key 'items.1.size' is true, expected: a "),
        ("numbers: {a: on}", ", line 1: key 'numbers.a' is true, expected: a whole number"),
    ],
)
def test_a_value_of_another_kind_is_not_converted(tmp_path: Path, text: str, says: str) -> None:
    assert says in mistake(tmp_path, text)


def test_a_section_in_the_environment_is_checked_as_a_file_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TESTED__SERVER", '{"port": true}')
    with pytest.raises(UserError) as raised:
        load(_Settings, None)
    assert raised.value.what == (
        "configuration from the environment: key 'server.port' is true, expected: a whole number"
    )


def test_plain_variables_are_texts_that_are_read_as_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TESTED__SERVER__PORT", "7")
    monkeypatch.setenv("TESTED__ENABLED", "0")
    settings = load(_Settings, None)
    assert (settings.server.port, settings.enabled) == (7, False)


def test_what_is_in_effect_reads_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TESTED__NAME", "env")
    settings = load(_Settings, None)
    file = tmp_path / "effective.yaml"
    file.write_text(as_yaml(settings), encoding="utf-8")
    monkeypatch.delenv("TESTED__NAME")
    assert load(_Settings, file) == settings


def test_the_schema_forbids_unknown_keys() -> None:
    schema = json.loads(json_schema(_Settings))
    assert schema["additionalProperties"] is False
    assert schema["properties"]["name"]["maxLength"] == 5
    json.dumps(schema)
