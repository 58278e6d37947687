"""The robot's images of a release: built, saved into one file, named with their digests."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from release_program.running import run

PLATFORMS: Final[Mapping[str, str]] = {"linux/amd64": "", "linux/arm64": "-arm64"}
"""Of robots; what each one's tags end with, as scripts/images has it on x86-64."""
_BUILD_WITHIN_S: Final = 4 * 3600.0
"""With another processor emulated, ten times as long as without."""
_SAVE_WITHIN_S: Final = 1200.0
_INSPECT_WITHIN_S: Final = 120.0


def build(root: Path, version: str, platform: str, epoch_s: int, *, anew: bool = False) -> str:
    """Builds the images, and returns their tag; .env and COMPOSE_FILE count, as in scripts/images.

    Args:
        root: of the source tree.
        version: what the tag begins with.
        platform: one of PLATFORMS.
        epoch_s: the images' time: seconds since 1970.
        anew: take nothing over from earlier builds, so that the packages are the newest.

    Raises:
        UserError: no engine answers, programs of the platform can't run here, or a build fails.
    """
    options = ["--no-cache"] if anew else []
    run(
        *(root / "scripts/images", "build", "--platform", platform),
        *options,
        within_s=_BUILD_WITHIN_S,
        environment={"TAG": version, "SOURCE_DATE_EPOCH": str(epoch_s)},
    )
    return version + PLATFORMS[platform]


def save(root: Path, tag: str, folder: Path) -> list[str]:
    """Writes the images, and IMAGES with a line "NAME:TAG sha256:DIGEST" for each; returns NAME:TAG of all.

    Raises:
        UserError: they are not there, or the disk is full.
    """
    listed = run(root / "scripts/images", "ids", within_s=_INSPECT_WITHIN_S, environment={"TAG": tag})
    (folder / "IMAGES").write_text(listed, encoding="utf-8")
    run(
        *(root / "scripts/images", "save", folder / f"robot-images-{tag}.tar.gz"),
        within_s=_SAVE_WITHIN_S,
        environment={"TAG": tag},
    )
    return [line.split()[0] for line in listed.splitlines()]
