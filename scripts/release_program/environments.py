"""Virtual environments made from a release alone: they prove that it installs without a registry."""

import sys
from pathlib import Path
from typing import Final

from release_program.distributions import Distribution
from release_program.running import run

_INSTALL_WITHIN_S: Final = 300.0


def install(distribution: Distribution, version: str, wheels: Path, environment: Path) -> Path:
    """Installs a distribution with all of its extras from a directory of wheels; returns the interpreter.

    Args:
        distribution: which.
        version: of it.
        wheels: all that it needs.
        environment: a new directory. It gets no pip, so that nothing but the distribution is in it.

    Raises:
        UserError: a wheel is missing, or does not fit this Python.
    """
    run(sys.executable, "-P", "-m", "venv", "--without-pip", environment, within_s=_INSTALL_WITHIN_S)
    interpreter = environment / "bin/python"
    extras = f"[{','.join(distribution.extras)}]" if distribution.extras else ""
    run(
        *(sys.executable, "-P", "-m", "pip", "--disable-pip-version-check", "--no-input"),
        *(
            "--python",
            interpreter,
            "install",
            "--quiet",
            "--no-index",
            "--find-links",
            wheels,
            "--no-compile",
        ),
        f"{distribution.name}{extras}=={version}",
        within_s=_INSTALL_WITHIN_S,
        environment={"PIP_FIND_LINKS": ""},
        remedy="Is a package in pyproject.toml and not in requirements/console.txt? Type: scripts/lock",
    )
    return interpreter
