"""The robot's images of a release: built, saved into one file, named with their digests."""

from pathlib import Path
from typing import Final

from release_program.running import run

_BUILD_WITHIN_S: Final = 3600.0
_SAVE_WITHIN_S: Final = 1200.0
_INSPECT_WITHIN_S: Final = 120.0


def build(root: Path, version: str) -> None:
    """Builds the images with the version as their tag; .env and COMPOSE_FILE count, as in scripts/images.

    Raises:
        UserError: no engine answers, or a build fails.
    """
    run(root / "scripts/images", "build", within_s=_BUILD_WITHIN_S, environment={"TAG": version})


def save(root: Path, version: str, folder: Path) -> list[str]:
    """Writes the images, and IMAGES with a line "NAME:TAG sha256:DIGEST" for each; returns NAME:TAG of all.

    Raises:
        UserError: they are not there, or the disk is full.
    """
    listed = run(root / "scripts/images", "ids", within_s=_INSPECT_WITHIN_S, environment={"TAG": version})
    (folder / "IMAGES").write_text(listed, encoding="utf-8")
    run(
        *(root / "scripts/images", "save", folder / f"robot-images-{version}.tar.gz"),
        within_s=_SAVE_WITHIN_S,
        environment={"TAG": version},
    )
    return [line.split()[0] for line in listed.splitlines()]
