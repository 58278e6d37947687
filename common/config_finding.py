"""What every doctor begins with: the configuration of its program."""

from collections.abc import Generator
from pathlib import Path
from typing import TypeVar

from common.config import Settings, load
from common.errors import UserError
from common.findings import Finding, good, wrong

_S = TypeVar("_S", bound=Settings)


def checked_settings(
    settings_type: type[_S], path: Path | None, program: str
) -> Generator[Finding, None, _S | None]:
    """Yields the finding on a configuration, and returns it; None if it is wrong.

    Args:
        settings_type: what it is read into.
        path: the file.
        program: the command that does not start with a wrong one.
    """
    try:
        settings = load(settings_type, path)
    except UserError as error:
        yield wrong("config", error.what, f"{program} does not start", error.remedy)
        return None
    yield good("config", f"{path or 'the environment'}: ok")
    return settings
