"""Software bills of materials in the CycloneDX format, of what is really installed."""

import sys
from pathlib import Path
from typing import Final

from release_program.running import run

_WITHIN_S: Final = 120.0


def write_of_environment(interpreter: Path, pyproject: Path, target: Path, epoch_s: int) -> None:
    """Writes the SBOM of a virtual environment as JSON, checked against CycloneDX's schema.

    Args:
        interpreter: of the environment.
        pyproject: of the distribution that the environment was made for: the main component.
        target: the file to write.
        epoch_s: its time: seconds since 1970.

    Raises:
        UserError: it can't be made.
    """
    run(
        *(
            Path(sys.executable).with_name("cyclonedx-py"),
            "environment",
            "--output-reproducible",
            "--validate",
        ),
        *("--output-format", "JSON", "--pyproject", pyproject, "--output-file", target, interpreter),
        within_s=_WITHIN_S,
        environment={"SOURCE_DATE_EPOCH": str(epoch_s)},
    )
