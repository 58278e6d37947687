"""Options of the command `check`, the same for all programs."""

from typing import Annotated, TypeAlias

import typer

PrintOption: TypeAlias = Annotated[
    bool, typer.Option("--print", help="Print the configuration in effect, with all defaults.")
]
SchemaOption: TypeAlias = Annotated[
    bool, typer.Option("--schema", help="Print the JSON schema of the file, for editors.")
]
