"""scripts/images without an engine: what it refuses and warns of, and how it reads an engine's answers."""

import gzip
import io
import json
import os
import subprocess
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def scripts_images(*words: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("ALLOW_STAND_INS", "ROS")}
    return subprocess.run(
        [ROOT / "scripts" / "images", *words],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env={**kept, **variables},
    )


@pytest.mark.parametrize(
    ("words", "variables"), [(["--ros", "wheels"], {}), ([], {"ROS": "wheels"})], ids=["option", "variable"]
)
def test_images_with_stand_ins_are_for_no_robot(words: list[str], variables: dict[str, str]) -> None:
    refused = scripts_images("build", *words, **variables)
    assert refused.returncode == 1
    assert "--ros packages" in refused.stderr
    assert "ALLOW_STAND_INS=1" in refused.stderr


@pytest.mark.parametrize(
    ("version", "bind", "warned"),
    [
        ("20.10.24+dfsg1", "127.0.0.1", True),
        ("27.5.1", "[::1]", True),
        ("28.0.0", "127.0.0.1", False),
        ("20.10.24", "0.0.0.0", False),  # noqa: S104  # binds nothing
    ],
)
def test_an_engine_that_shows_the_video_to_neighbours_is_named(
    tmp_path: Path, version: str, bind: str, warned: bool
) -> None:
    """Docker before 28 does, where it publishes a port on the loopback (moby issue 45610)."""
    docker, file = tmp_path / "docker", tmp_path / "images.tar.gz"
    docker.write_text(f'#!/bin/sh\n[ "$1" = load ] && cat > /dev/null || echo "{version}"\n')
    docker.chmod(0o755)
    file.write_bytes(gzip.compress(b"images"))
    loaded = scripts_images("load", file, PATH=f"{tmp_path}:{os.environ['PATH']}", PREVIEW_BIND=bind)
    assert loaded.returncode == 0, loaded.stderr
    assert (f"Docker {version} lets other machines" in loaded.stderr) is warned
    assert ("encrypted: true" in loaded.stderr) is warned


DEBIAN, ROS = (f"sha256:{digit * 64}" for digit in "ab")


def digests(directory: Path, *, engine: str = "true", **known: str) -> subprocess.CompletedProcess[str]:
    """What scripts/images makes of images of which the engine knows these digests, one a line.

    Args:
        directory: for the engine's double.
        engine: what `docker info` does.
        known: `debian` and `ros`; an image that is not named is not there.
    """
    cases = [f"*' {name}:'*) printf '{text}' ;;" for name, text in known.items()]
    docker = directory / "docker"
    docker.write_text(
        f'#!/bin/sh\n[ "$1" != info ] || exec {engine}\n'
        f'case "$*" in {" ".join(cases)} *) echo "no such image" >&2; exit 1 ;; esac\n'
    )
    docker.chmod(0o755)
    return scripts_images("digests", PATH=f"{directory}:{os.environ['PATH']}")


def test_base_images_are_named_with_their_digests(tmp_path: Path) -> None:
    printed = digests(tmp_path, debian=f"debian@{DEBIAN}\\n", ros=f"ros@{ROS}\\n")
    assert (printed.returncode, printed.stderr) == (0, "")
    assert printed.stdout.splitlines() == [
        f"DEBIAN_IMAGE=debian:bookworm-slim@{DEBIAN}",
        f"ROS_IMAGE=ros:jazzy-ros-core@{ROS}",
    ]


def test_the_digest_is_that_of_the_images_own_repository(tmp_path: Path) -> None:
    """By its name the engine finds no other one."""
    mirrored = f"mirror.test/debian@{ROS}\\ndebian@{DEBIAN}\\n"
    printed = digests(tmp_path, debian=mirrored, ros=f"mirror.test/ros@{ROS}\\n")
    assert printed.stdout.splitlines() == [f"DEBIAN_IMAGE=debian:bookworm-slim@{DEBIAN}"]
    assert printed.returncode == 1
    assert "docker pull ros:jazzy-ros-core" in printed.stderr


@pytest.mark.parametrize("known", [{}, {"debian": ""}], ids=["not there", "made here"])
def test_an_image_without_a_digest_is_named_with_what_to_type(tmp_path: Path, known: dict[str, str]) -> None:
    """And the other one is printed all the same."""
    printed = digests(tmp_path, ros=f"ros@{ROS}\\n", **known)
    assert printed.stdout.splitlines() == [f"ROS_IMAGE=ros:jazzy-ros-core@{ROS}"]
    assert printed.returncode == 1
    assert "docker pull debian:bookworm-slim" in printed.stderr


def test_without_an_engine_no_image_is_to_be_pulled(tmp_path: Path) -> None:
    printed = digests(tmp_path, engine="false")
    assert (printed.returncode, printed.stdout) == (1, "")
    assert "docker/engine start" in printed.stderr
    assert "docker pull" not in printed.stderr


def save_of(directory: Path, time: str) -> Path:
    """An archive as `docker save` writes it: of one image, made at this time, without layers."""
    configuration = {
        "created": time,
        "config": {"Labels": {"com.docker.compose.project": "lab7"}},
        "history": [{"created": time}],
        "rootfs": {"type": "layers", "diff_ids": []},
    }
    manifest = [{"Config": "one.json", "RepoTags": ["robot-bridge:1.4.0"], "Layers": []}]
    file = directory / "save"
    with tarfile.open(file, "w") as archive:
        for name, value in (("one.json", configuration), ("manifest.json", manifest)):
            content = json.dumps(value).encode()
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return file


ENGINE = """#!/bin/sh
echo "$*" >> "$(dirname "$0")/calls"
case "$1 $2" in
  "save --output") cp "$(dirname "$0")/save" "$3" ;;
  "load ") cat > "$(dirname "$0")/loaded" ;;
  "image inspect") echo 0 ;;
  "version "*) echo 28 ;;
esac
"""


@pytest.fixture
def engine(tmp_path: Path) -> Path:
    """The directory of an engine's double: what it is asked, what it loads, and `save`, what it saves."""
    directory = tmp_path / "engine"
    directory.mkdir()
    (directory / "docker").write_text(ENGINE)
    (directory / "docker").chmod(0o755)
    return directory


def build(engine: Path, *words: str, **variables: str) -> str:
    """Builds with the double; returns what it was asked."""
    ended = scripts_images(
        "build", "--ros", "packages", *words, PATH=f"{engine}:{os.environ['PATH']}", TAG="1.4.0", **variables
    )
    assert ended.returncode == 0, ended.stderr
    return (engine / "calls").read_text()


def test_two_builds_with_the_time_of_their_sources_are_the_same_image(engine: Path) -> None:
    loaded = []
    for time in ("2026-11-28T10:15:24.746349172Z", "2026-11-29T00:00:00Z"):
        save_of(engine, time)
        asked = build(engine, "robot-bridge", SOURCE_DATE_EPOCH="1767323045")
        (saved,) = (line for line in asked.splitlines() if line.startswith("save "))
        assert saved.endswith(" robot-bridge:1.4.0")
        (engine / "calls").unlink()
        loaded.append((engine / "loaded").read_bytes())
    assert loaded[0] == loaded[1]
    assert b'"created":"2026-01-02T03:04:05Z"' in loaded[0]


def test_without_that_time_what_was_built_stays_as_it_is(engine: Path) -> None:
    asked = build(engine, "robot-bridge", SOURCE_DATE_EPOCH="")
    assert "save" not in asked
    assert not (engine / "loaded").exists()


@pytest.mark.parametrize("time", ["yesterday", "-1", "1.5", "999999999999"])
def test_a_time_that_is_no_number_of_seconds_is_refused_before_the_build(engine: Path, time: str) -> None:
    ended = scripts_images(
        "build", "--ros", "packages", PATH=f"{engine}:{os.environ['PATH']}", SOURCE_DATE_EPOCH=time
    )
    assert ended.returncode == 1
    assert f"SOURCE_DATE_EPOCH is '{time}'" in ended.stderr
    assert not (engine / "calls").exists()


@pytest.mark.parametrize(
    ("words", "time"), [(["save", "/dev/null/file"], ""), (["build", "--ros", "packages"], "1767323045")]
)
def test_what_needs_python_names_the_release_that_it_needs(engine: Path, words: list[str], time: str) -> None:
    (engine / "python3").write_text("#!/bin/sh\nexit 1\n")
    (engine / "python3").chmod(0o755)
    ended = scripts_images(*words, PATH=f"{engine}:{os.environ['PATH']}", SOURCE_DATE_EPOCH=time)
    assert ended.returncode == 1
    assert "no python3 of 3.11 or newer" in ended.stderr
    assert not (engine / "calls").exists()


def test_a_build_without_that_time_needs_no_python(engine: Path) -> None:
    """A robot's may be older."""
    (engine / "python3").write_text("#!/bin/sh\nexit 1\n")
    (engine / "python3").chmod(0o755)
    assert "compose --progress quiet build" in build(engine, SOURCE_DATE_EPOCH="")


def test_an_archive_that_can_not_be_read_ends_the_build(engine: Path) -> None:
    (engine / "save").write_bytes(b"no archive")
    ended = scripts_images(
        "build", "--ros", "packages", PATH=f"{engine}:{os.environ['PATH']}", SOURCE_DATE_EPOCH="1767323045"
    )
    assert ended.returncode == 1
    assert "the times of the images can't be set" in ended.stderr
    assert not list((ROOT / ".cache").glob("images.*"))


def test_nothing_is_taken_over_where_that_is_asked(engine: Path) -> None:
    build(engine, "--no-cache", "robot-bridge", SOURCE_DATE_EPOCH="")
    asked = build(engine, "robot-bridge", SOURCE_DATE_EPOCH="")
    composed = [line for line in asked.splitlines() if line.startswith("compose ")]
    assert composed == [
        "compose --progress quiet build --no-cache bridge",
        "compose --progress quiet build bridge",
    ]


def test_images_are_saved_as_they_are_and_as_the_same_bytes(engine: Path, tmp_path: Path) -> None:
    saved: list[bytes] = []
    for name in ("first", "second"):
        os.utime(save_of(engine, "2026-11-28T10:15:24Z"), (len(saved), len(saved)))
        ended = scripts_images("save", tmp_path / name, "robot-bridge", PATH=f"{engine}:{os.environ['PATH']}")
        assert ended.returncode == 0, ended.stderr
        saved.append((tmp_path / name).read_bytes())
    assert saved[0] == saved[1]
    assert b'"created": "2026-11-28T10:15:24Z"' in gzip.decompress(saved[0])
    assert sorted(each.name for each in tmp_path.iterdir()) == ["engine", "first", "second"]


def test_an_image_that_does_not_exist_is_not_saved(engine: Path, tmp_path: Path) -> None:
    ended = scripts_images("save", tmp_path / "file", "robot-arm", PATH=f"{engine}:{os.environ['PATH']}")
    assert ended.returncode == 2
    assert "usage: scripts/images" in ended.stderr
    assert not (tmp_path / "file").exists()
