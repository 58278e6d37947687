"""The command line of scripts/release."""

import argparse
import os
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Final

from common.errors import UserError
from release_program import git, image_sbom, images, programs, sbom
from release_program.changelog import section
from release_program.distributions import DISTRIBUTIONS
from release_program.environments import install
from release_program.packages import build, stage
from release_program.preconditions import Facts, refusals
from release_program.sums import write_sums
from release_program.wheelhouse import build_sources, download

_ROOT: Final = Path(__file__).parents[2]
_PYTHONS: Final = ("3.11", "3.12", "3.13")
"""Of Debian 12, Ubuntu 24.04 and Debian 13."""


def main() -> int:
    """Makes the release and returns 0; prints one line and returns 1 where that is refused or fails."""
    parser = argparse.ArgumentParser(prog="scripts/release", description="Makes a release from the commit.")
    parser.add_argument("version", metavar="VERSION", help="the version of pyproject.toml")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="by default build/robot-gateway-VERSION, or build/robot-gateway-VERSION-arm64",
    )
    parser.add_argument(
        "--python",
        action="append",
        choices=_PYTHONS,
        help="that of the computers which install it without a registry; may be repeated; by default all",
    )
    parser.add_argument(
        "--without-images",
        action="store_true",
        help="a robot that runs by compose.yaml can't be upgraded to it",
    )
    parser.add_argument(
        "--platform",
        choices=list(images.PLATFORMS),
        default="linux/amd64",
        help="of the robots that the images are for; linux/amd64 by default",
    )
    parser.add_argument(
        "--no-cache",
        action="store_true",
        help="take nothing over from earlier builds of the images: the newest Debian packages",
    )
    options = parser.parse_args()
    platform = None if options.without_images else options.platform
    name = f"robot-gateway-{options.version}{images.PLATFORMS[platform] if platform else ''}"
    output = (options.output or _ROOT / "build" / name).absolute()
    try:
        commit = _permitted(options.version)
        pythons = tuple(options.python or _PYTHONS)
        _make(options.version, commit, output, pythons, platform, anew=options.no_cache)
    except UserError as error:
        print(f"release: {error}", file=sys.stderr)
        return int(error.exit_code)
    except OSError as error:
        print(f"release: {error.filename or output}: {error.strerror}. Nothing was made", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("release: interrupted; nothing was made", file=sys.stderr)
        return 1
    print(f"release: {output}", file=sys.stderr)
    return 0


def _permitted(version: str) -> git.Commit:
    """Returns the commit to release, or raises a UserError with all that speaks against it."""
    commit = git.head(_ROOT)
    facts = Facts(
        project_version=_project_version(),
        changelog=(_ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        changed_files=git.changed_files(_ROOT),
        has_frozen_schema=(_ROOT / f"proto/locked/{version}.binpb").is_file(),
        revision=commit.revision,
        tagged_revision=git.tagged(_ROOT, f"v{version}"),
        machine=os.uname().machine,
    )
    if found := refusals(version, facts):
        raise UserError(f"{version} can't be released: {'; '.join(found)}")
    return commit


def _project_version() -> str:
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return str(project["version"])


def _make(
    version: str,
    commit: git.Commit,
    output: Path,
    pythons: tuple[str, ...],
    platform: str | None,
    *,
    anew: bool,
) -> None:
    """Makes all parts beside `output`, which appears when all are complete; no images without a platform.

    With `anew`, the images take nothing over from earlier builds.
    """
    if output.exists():
        raise UserError(f"{output} exists", f"Type: rm -r {output}, or name another one with --output")
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".release-", dir=output.parent) as scratch:
        made, work = Path(scratch) / "made", Path(scratch) / "work"
        for folder in ("wheels", "sdists", "robot", "sbom"):
            (made / folder).mkdir(parents=True)
        archived = made / f"robot-gateway-{version}.tar.gz"
        git.archive(_ROOT, commit, archived.name.removesuffix(".tar.gz"), archived)
        tree = git.export(archived, work / "tree")
        _say("building wheels and sdists")
        for distribution in DISTRIBUTIONS:
            stage(distribution, tree, work / "sources" / distribution.name)
            build(work / "sources" / distribution.name, made / "sdists", made / "wheels", commit.epoch_s)
        _say(f"downloading what they need on Python {', '.join(pythons)}")
        console = [tree / "requirements/console.txt"]
        download(console, pythons, ["x86_64"], made / "wheels")
        build_sources(console, made / "wheels", commit.epoch_s)
        _say("installing them without a registry, and listing what was installed")
        for distribution in DISTRIBUTIONS:
            interpreter = install(distribution, version, made / "wheels", work / distribution.name)
            sbom.write_of_environment(
                interpreter,
                work / "sources" / distribution.name / "pyproject.toml",
                made / "sbom" / f"{distribution.stem}-{version}.cdx.json",
                commit.epoch_s,
            )
        _say("downloading what the robot's programs need without Docker, and installing it")
        programs.download(tree, pythons, made / "robot")
        sbom.write_of_environment(
            programs.install(tree, made / "robot", work / "programs"),
            tree / "pyproject.toml",
            made / "sbom" / f"without_docker-{version}.cdx.json",
            commit.epoch_s,
        )
        tag = _add_images(made, version, commit, platform, anew=anew) if platform else ""
        _write_texts(made, tree, version, commit, tag)
        write_sums(made)
        made.rename(output)


def _add_images(made: Path, version: str, commit: git.Commit, platform: str, *, anew: bool) -> str:
    """Returns their tag."""
    _say(f"building the images for {platform}")
    tag = images.build(_ROOT, version, platform, commit.epoch_s, anew=anew)
    _say("saving them, and listing what is in them")
    (made / "images").mkdir()
    for image in images.save(_ROOT, tag, made / "images"):
        name = image.partition(":")[0]
        image_sbom.write_of_image(image, version, made / f"sbom/{name}-{version}.cdx.json", commit.epoch_s)
    return tag


def _write_texts(made: Path, tree: Path, version: str, commit: git.Commit, tag: str) -> None:
    changes = section((tree / "CHANGELOG.md").read_text(encoding="utf-8"), version) or ("", "")
    (made / "CHANGES.md").write_text(f"# {version} - {changes[0]}\n\n{changes[1]}\n", encoding="utf-8")
    facts = f"VERSION={version}\nREVISION={commit.revision}\n" + (f"TAG={tag}\n" if tag else "")
    (made / "RELEASE").write_text(facts, encoding="utf-8")
    template = (tree / "scripts/release_program/INSTALL.md").read_text(encoding="utf-8")
    (made / "INSTALL.md").write_text(template.replace("VERSION", version), encoding="utf-8")


def _say(text: str) -> None:
    print(f"release: {text}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
