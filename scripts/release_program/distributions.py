"""The Python distributions of a release, and the pyproject.toml of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import tomlkit
from packaging.requirements import Requirement

_BUILD_SYSTEM: Final = {"requires": ["hatchling>=1.27"], "build-backend": "hatchling.build"}


@dataclass(frozen=True, slots=True)
class Distribution:
    """What one wheel has.

    Attributes:
        name: as pip knows it.
        summary: one line.
        readme: a page of the source tree.
        entries: packages it offers, dotted; it has everything that they import (`modules.closure`).
        requires: names of packages that it needs; the project's pyproject.toml has their versions.
        extras: the same for what is optional: of an extra, the project's extra with these packages.
        scripts: commands it installs; the project's pyproject.toml says what they call.
        builds_on: another one that it needs in exactly its own version. It has no file of that one.
    """

    name: str
    summary: str
    readme: str
    entries: tuple[str, ...]
    requires: tuple[str, ...]
    extras: Mapping[str, str] = field(default_factory=dict)
    scripts: tuple[str, ...] = ()
    builds_on: "Distribution | None" = None

    @property
    def stem(self) -> str:
        """The name as file names have it."""
        return self.name.replace("-", "_")


CLIENT: Final = Distribution(
    name="robot-gateway-client",
    summary="Client library for Robot Gateway: a robot's status, events, preview, driving and recordings.",
    readme="docs/client.md",
    entries=("console.client", "console.robots", "console.credentials"),
    requires=("grpcio", "grpcio-status", "protobuf", "google-crc32c", "tomlkit", "zeroconf"),
)
CONSOLE: Final = Distribution(
    name="robot-gateway-console",
    summary="robotctl: shows a robot's status and live video, controls its preview, drives it.",
    readme="docs/robotctl.md",
    entries=("console", "practice"),
    requires=("typer", "rich", "nats-py", "nkeys"),
    # Qt for the windows; GStreamer comes from the system.
    extras={"video": "console", "gamepad": "gamepad"},
    scripts=("robotctl",),
    builds_on=CLIENT,
)
DISTRIBUTIONS: Final = (CLIENT, CONSOLE)


def pyproject(distribution: Distribution, project: Mapping[str, Any], packages: list[str]) -> str:
    """Returns the text of the distribution's pyproject.toml.

    Args:
        distribution: which.
        project: the table [project] of the whole project, which has version, licence and bounds.
        packages: top-level packages in its source tree.

    Raises:
        LookupError: the project lacks a dependency, an extra or a command that the distribution names.
    """
    optional = project["optional-dependencies"]
    bounds = {
        Requirement(text).name.lower(): text
        for text in [*project["dependencies"], *(text for extra in optional.values() for text in extra)]
    }
    needed = [bounds[name.lower()] for name in distribution.requires]
    if distribution.builds_on:
        needed.insert(0, f"{distribution.builds_on.name}=={project['version']}")
    table = {
        "name": distribution.name,
        "version": project["version"],
        "description": distribution.summary,
        "readme": "README.md",
        "license": project["license"],
        "license-files": project["license-files"],
        "requires-python": project["requires-python"],
        "dependencies": needed,
        "optional-dependencies": {name: optional[source] for name, source in distribution.extras.items()},
        "scripts": {name: project["scripts"][name] for name in distribution.scripts},
    }
    targets = {"wheel": {"only-include": packages}}
    return tomlkit.dumps(
        {
            "build-system": _BUILD_SYSTEM,
            "project": table,
            "tool": {"hatch": {"build": {"targets": targets}}},
        }
    )
