"""Loads and validates a program's YAML configuration file; environment variables override it."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from pydantic_settings import (
    BaseSettings,
    EnvSettingsSource,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
)

from common.config_kinds import misfits
from common.config_problems import first_problem
from common.errors import ExitCode, UserError


class Section(BaseModel):
    """One section of a configuration file. Unknown keys are errors; values are immutable.

    The text below a key explains it in the JSON schema, too.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Settings(BaseSettings):
    """Base class of a program's whole configuration.

    A program's settings derive from this and set `env_prefix` in their own `model_config`. With the prefix
    `GATEWAY__`, the variable `GATEWAY__GRPC__PORT` overrides the key `port` under `grpc`.
    """

    model_config: ClassVar[SettingsConfigDict] = SettingsConfigDict(
        extra="forbid",
        frozen=True,
        env_nested_delimiter="__",
        # Compose files can't leave a variable out, only leave it empty.
        env_ignore_empty=True,
        nested_model_default_partial_update=True,
        use_attribute_docstrings=True,
    )
    spellings: ClassVar[Mapping[str, str]] = {}
    """Keys of a file that Python spells in another way, as environment variables do."""

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],  # noqa: ARG003  # pydantic passes all of them by name
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,  # noqa: ARG003  # as above
        file_secret_settings: PydanticBaseSettingsSource,  # noqa: ARG003  # as above
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Returns the sources in order of precedence: the environment, then the file."""
        return env_settings, init_settings

    def check(self) -> None:
        """Raises a `SettingsConflictError` where values are valid each, but not together."""


SettingsT = TypeVar("SettingsT", bound=Settings)


class SettingsConflictError(Exception):
    """Values that are valid each, but not together.

    Args:
        location: the keys and list positions that lead to the one to change.
        what: what is wrong.
        remedy: what to do.
    """

    def __init__(self, location: tuple[int | str, ...], what: str, remedy: str) -> None:
        super().__init__(what)
        self.location = location
        self.what = what
        self.remedy = remedy


def load(
    settings_type: type[SettingsT], path: Path | None, *checks: Callable[[SettingsT], None]
) -> SettingsT:
    """Reads and validates a configuration file; without a path, defaults and environment apply alone.

    Args:
        settings_type: what it is read into.
        path: the file.
        checks: more than the settings' own `check`; they raise `SettingsConflictError`.

    Raises:
        UserError: the file can't be read, is not YAML, or has an unknown key, a key twice or a wrong value.
            The text names the file, the line, the key, the value and what is expected.
    """
    values, line_of = _read(path) if path else ({}, _no_line)
    prefix = settings_type.model_config.get("env_prefix", "")
    remedy = f"Correct it in the file or in the {prefix}* environment variable"
    if misfit := next(misfits(settings_type, values), None):
        raise _error(f"{path}{line_of(misfit.location)}: {misfit.text}", remedy)
    try:
        if misfit := next(misfits(settings_type, EnvSettingsSource(settings_type)()), None):
            raise _error(f"from the environment: {misfit.text}", remedy)
        settings = settings_type(**_respelled(values, settings_type.spellings))
    except SettingsError as error:
        # A list or a section in a variable that is no JSON; the sentence has the name in quotation marks.
        key = str(error).partition('"')[2].partition('"')[0]
        raise _error(
            f"from the environment: key '{key}' is not JSON",
            f'Write lists and sections as JSON: {prefix}{key.upper()}=["a", "b"] for example',
        ) from error
    except ValidationError as error:
        problem = first_problem(error, settings_type)
        raise _error(
            f"{path or 'from the environment'}{line_of(problem.location)}: {problem.text}",
            remedy,
        ) from error
    try:
        settings.check()
        for check in checks:
            check(settings)
    except SettingsConflictError as error:
        where = f"{path or 'from the environment'}{line_of(error.location)}"
        raise _error(f"{where}: {error.what}", error.remedy) from error
    return settings


def as_yaml(settings: Settings) -> str:
    """Returns the settings as they are in effect, with all defaults and environment variables."""
    return yaml.safe_dump(
        settings.model_dump(mode="json", by_alias=True), sort_keys=False, allow_unicode=True
    )


def json_schema(settings_type: type[Settings]) -> str:
    """Returns the JSON schema of a configuration file, for editors, as text."""
    # As a plain adapter: the schema of settings would be the same, but typed as an instance method.
    return json.dumps(TypeAdapter(settings_type).json_schema(), indent=2)


def _respelled(value: Any, spellings: Mapping[str, str]) -> Any:
    """Returns a file's content with Python's spelling of its keys, so that variables override them."""
    if isinstance(value, dict):
        return {spellings.get(key, key): _respelled(inner, spellings) for key, inner in value.items()}
    return value


class _KeyTwiceError(yaml.MarkedYAMLError):
    """A mapping has a key twice."""


class _Loader(yaml.SafeLoader):
    """Refuses a key that stands twice in one mapping, of which YAML libraries take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, yaml.Node] = {}
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value != "<<":
                if key.value in seen:
                    first = seen[key.value].start_mark.line + 1
                    what = f"key '{key.value}' is there twice, first in line {first}"
                    raise _KeyTwiceError(None, None, what, key.start_mark)
                seen[key.value] = key
        return super().construct_mapping(node, deep)


_LineOf = Callable[[tuple[int | str, ...]], str]


def _read(path: Path) -> tuple[dict[str, Any], _LineOf]:
    """Returns the file's content, and what finds the line of a key in it."""
    try:
        loader = _Loader(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise _error(f"{path} can't be read: {error}", "Name a readable file with --config") from error
    except yaml.YAMLError as error:
        raise _not_yaml(path, error) from error
    try:
        node = loader.get_single_node()
        values = loader.construct_document(node) if node else None
    # PyYAML raises ValueError for a date that does not exist and RecursionError for deep nesting.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise _not_yaml(path, error) from error
    finally:
        loader.dispose()
    if node is None or values is None:
        return {}, _no_line
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise _error(f"{path} holds a {kind} at the top level", "Write keys and values, 'grpc:' for example")
    # YAML keys may be numbers or dates; as text, they are reported as unknown keys like any other.
    return {str(key): value for key, value in values.items()}, lambda location: _line(node, location)


def _not_yaml(path: Path, error: Exception) -> UserError:
    mark = getattr(error, "problem_mark", None)
    if mark is None:
        return _error(f"{path} is not YAML: {error}")
    verdict = "" if isinstance(error, _KeyTwiceError) else " is not YAML"
    return _error(f"{path}, line {mark.line + 1}{verdict}: {getattr(error, 'problem', '')}")


def _line(node: yaml.Node, location: tuple[int | str, ...]) -> str:
    """Returns where the deepest part of a location stands, ", line 7"; empty where the file has none."""
    line = None
    for part in location:
        if isinstance(node, yaml.MappingNode):
            spelled = str(part).replace("_", "-")
            found = next(
                (pair for pair in node.value if str(pair[0].value).replace("_", "-") == spelled), None
            )
            if found is None:
                continue  # A part that pydantic adds, such as the kind of a union's member.
            line, node = found[0].start_mark.line, found[1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line
    return "" if line is None else f", line {line + 1}"


def _no_line(_location: tuple[int | str, ...]) -> str:
    return ""


def _error(problem: str, remedy: str = "") -> UserError:
    return UserError(f"configuration {problem}", remedy, exit_code=ExitCode.USAGE)
