"""The one way in which robotctl imports late, so that help and completion start without the libraries."""

import importlib
from typing import Any

import typer
from typer.core import TyperCommand
from typer.main import get_command

from common.command_line import read_plainly
from console.cli.lasting_imports import lasting_imports


def imported(place: str) -> Any:
    """Imports and returns an object of a module, named MODULE:ATTRIBUTE."""
    module, _, attribute = place.partition(":")
    return getattr(importlib.import_module(module), attribute)


class LazyCommand(TyperCommand):
    """Stands in its group for a command, which is imported when it runs, shows its help or is completed.

    Args:
        name: The command's name.
        place: MODULE:ATTRIBUTE of its function, or of the `typer.Typer` of a group of commands.
        summary: Its line in the group's help.
    """

    def __init__(self, name: str, place: str, summary: str) -> None:
        super().__init__(name, help=summary, short_help=summary)
        self._place = place

    def make_context(self, *args: Any, **options: Any) -> Any:
        """Returns the context of the command itself (Click's protocol), which continues without this one."""
        with lasting_imports():
            command = self.load()
        return command.make_context(*args, **options)

    def load(self) -> Any:
        """Imports and returns the command."""
        loaded = imported(self._place)
        if not isinstance(loaded, typer.Typer):
            app = typer.Typer(add_completion=False, rich_markup_mode=None)
            app.command(self.name)(loaded)
            loaded = app
        command = get_command(loaded)
        read_plainly(command)
        return command
