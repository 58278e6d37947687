"""The child's side of common.trial; imports little, because every trial starts a process."""

import importlib
import json
import os
import sys
from typing import Any, Final, NoReturn

from common.child import end_with_parent
from common.errors import UserError

_LIFETIME_S: Final = 90
"""More than any parent waits."""


def report(error: str = "", **result: Any) -> NoReturn:
    """Reports the result of a trial and ends the process.

    Nothing is stopped or freed: a driver that hangs while closing can't delay the result.

    Args:
        error: why the trial failed; empty if it did not.
        result: what `run` returns, as far as JSON can express it.
    """
    print(json.dumps({"error": " ".join(error.split()), **result}), flush=True)
    os._exit(0)


def _main() -> None:
    parent, module, *arguments = sys.argv[1:]
    # Before the module is imported: to import GStreamer may hang as well.
    end_with_parent(int(parent), _LIFETIME_S)
    try:
        importlib.import_module(module).main(*arguments)
    except UserError as error:
        report(str(error))


if __name__ == "__main__":
    _main()
