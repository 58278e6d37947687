"""Loads and validates a program's YAML configuration file; environment variables override it."""

from pathlib import Path
from typing import Any, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from common.errors import ExitCode, UserError


class Section(BaseModel):
    """One section of a configuration file. Unknown keys are errors; values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Settings(BaseSettings):
    """Base class of a program's whole configuration.

    A program's settings derive from this and set `env_prefix` in their own `model_config`. With the prefix
    `GATEWAY__`, the variable `GATEWAY__GRPC__PORT` overrides the key `port` under `grpc`.
    """

    model_config: ClassVar[SettingsConfigDict] = SettingsConfigDict(
        extra="forbid", frozen=True, env_nested_delimiter="__", nested_model_default_partial_update=True
    )

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


SettingsT = TypeVar("SettingsT", bound=Settings)


def load(settings_type: type[SettingsT], path: Path | None) -> SettingsT:
    """Reads and validates a configuration file; without a path, defaults and environment apply alone.

    Raises:
        UserError: the file can't be read, is not YAML, or has an unknown key or an invalid value. The text
            names the file, the key, the value and the values allowed.
    """
    values = _read(path) if path else {}
    try:
        return settings_type(**values)
    except ValidationError as error:
        prefix = settings_type.model_config.get("env_prefix", "")
        raise _error(
            f"{path or 'from the environment'}: {_first_problem(error)}",
            f"Correct it in the file or in the {prefix}* environment variable",
        ) from error


def _read(path: Path) -> dict[str, Any]:
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise _error(f"{path} can't be read: {error}", "Name a readable file with --config") from error
    # PyYAML raises ValueError for a date that does not exist and RecursionError for deep nesting.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise _error(f"{path} is not YAML: {error}") from error
    if values is None:
        return {}
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise _error(f"{path} holds a {kind} at the top level", "Write keys and values, 'grpc:' for example")
    # YAML keys may be numbers or dates; as text, they are reported as unknown keys like any other.
    return {str(key): value for key, value in values.items()}


def _error(problem: str, remedy: str = "") -> UserError:
    return UserError(f"configuration {problem}", remedy, exit_code=ExitCode.USAGE)


def _first_problem(error: ValidationError) -> str:
    problems = error.errors(include_url=False)
    first = problems[0]
    key = ".".join(str(part) for part in first["loc"]) or "(top)"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        return f"unknown key '{key}'{more}"
    return f"key '{key}' is {first['input']!r}: {first['msg']}{more}"
