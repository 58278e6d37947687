"""What the command lines of the programs on the robot share: options, and the command `check`."""

from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from common.config import Settings, as_yaml, json_schema, load

PrintOption: TypeAlias = Annotated[
    bool, typer.Option("--print", help="Print the configuration in effect, with all defaults.")
]
SchemaOption: TypeAlias = Annotated[
    bool, typer.Option("--schema", help="Print the JSON schema of the file, for editors.")
]
JsonOption: TypeAlias = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]


def config_option(program: str) -> Any:
    """Returns the option `--config` of a program, whose variables begin with its name in capitals."""
    name = program.upper()
    return typer.Option(
        "--config",
        envvar=f"ROBOT_{name}_CONFIG",
        help=f"YAML file; default: built-in values and {name}__... variables.",
    )


def check_settings(
    settings_type: type[Settings], path: Path | None, *, in_effect: bool, schema: bool
) -> None:
    """Checks a configuration and prints that it is good, or what was asked for.

    Args:
        settings_type: what it is read into.
        path: the file.
        in_effect: whether to print the configuration in effect.
        schema: whether to print the schema, and check nothing.

    Raises:
        UserError: the configuration is wrong.
    """
    if schema:
        print(json_schema(settings_type))
        return
    settings = load(settings_type, path)
    if in_effect:
        print(as_yaml(settings), end="")
    else:
        print(f"{path or 'the environment'}: ok")
