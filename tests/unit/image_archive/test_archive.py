"""The archive of images: what makes it the same bytes, and what stays as it was."""

import gzip
import hashlib
import importlib.util
import io
import json
import os
import py_compile
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from image_archive.archive import write
from image_archive.layers import FILE_TIME_S

from common.errors import UserError
from tests.support.engine import ROOT

CREATED = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
BUILT_S, LATER_S = 1795860915, 1795947315


def entry(name: str, content: bytes = b"", **attributes: Any) -> tuple[tarfile.TarInfo, bytes]:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    for attribute, value in {"mtime": BUILT_S, **attributes}.items():
        setattr(info, attribute, value)
    return info, content


def tar(*entries: tuple[tarfile.TarInfo, bytes]) -> bytes:
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for info, content in entries:
            archive.addfile(info, io.BytesIO(content))
    return packed.getvalue()


@dataclass(frozen=True)
class Image:
    """An image as an engine has it."""

    name: str
    layers: Sequence[bytes]
    created: str = "2026-11-28T10:15:24.746349172Z"
    labels: dict[str, str] = field(default_factory=dict)

    def configuration(self) -> bytes:
        """In the order and spelling of an engine."""
        step = {"created": self.created, "created_by": "RUN a && b # buildkit"}
        digests = [f"sha256:{hashlib.sha256(layer).hexdigest()}" for layer in self.layers]
        value = {
            "architecture": "amd64",
            "os": "linux",
            "created": self.created,
            "config": {"User": "10005:10000", "Labels": self.labels, "Cmd": ["robot"]},
            "history": [step, {**step, "empty_layer": True}],
            "rootfs": {"type": "layers", "diff_ids": digests},
        }
        return json.dumps(value, indent=1).encode()


def saved(file: Path, *images: Image, time_s: int = 0, compressed: bool = False) -> Path:
    """Writes what `docker save` of Docker 20.10 does: each layer once, and links to it."""
    entries: dict[str, tuple[tarfile.TarInfo, bytes]] = {}
    homes: dict[bytes, str] = {}
    manifest = []
    for image in images:
        text = image.configuration()
        configuration = f"{hashlib.sha256(text).hexdigest()}.json"
        entries[configuration] = entry(configuration, text, mtime=time_s)
        members = []
        for number, layer in enumerate(image.layers):
            member = f"{hashlib.sha256(text + bytes([number])).hexdigest()}/layer.tar"
            home = homes.setdefault(layer, member)
            content = gzip.compress(layer) if compressed else layer
            entries[member] = (
                entry(member, content, mtime=time_s)
                if home == member
                else entry(member, type=tarfile.SYMTYPE, linkname=f"../{home}")
            )
            members.append(member)
        manifest.append({"Config": configuration, "RepoTags": [f"{image.name}:1"], "Layers": members})
    listed = entry("manifest.json", json.dumps(manifest).encode())
    file.write_bytes(tar(*entries.values(), listed))
    return file


def saved_as_oci_layout(file: Path, *images: Image, compressed: bool) -> Path:
    """Writes what `docker save` of Docker 25 and later does: an OCI layout, with the older list beside it."""
    entries = {"oci-layout": entry("oci-layout", b'{"imageLayoutVersion": "1.0.0"}')}

    def blob(content: bytes) -> str:
        name = f"blobs/sha256/{hashlib.sha256(content).hexdigest()}"
        entries[name] = entry(name, content)
        return name

    manifest = [
        {
            "Config": blob(image.configuration()),
            "RepoTags": [f"{image.name}:1"],
            "Layers": [
                blob(gzip.compress(layer, mtime=0) if compressed else layer) for layer in image.layers
            ],
        }
        for image in images
    ]
    entries["manifest.json"] = entry("manifest.json", json.dumps(manifest).encode())
    file.write_bytes(tar(*entries.values()))
    return file


def written(file: Path, created: datetime | None = CREATED) -> bytes:
    sink = io.BytesIO()
    write(file, sink, created)
    return sink.getvalue()


def contents(archive: bytes) -> dict[str, bytes]:
    with tarfile.open(fileobj=io.BytesIO(archive)) as read:
        return {each.name: (read.extractfile(each) or io.BytesIO()).read() for each in read}


def image_of(archive: bytes, name: str) -> tuple[dict[str, Any], list[bytes]]:
    """An image's configuration and its layers, whose digests have to be those in it."""
    files = contents(archive)
    (listed,) = (each for each in json.loads(files["manifest.json"]) if f"{name}:1" in each["RepoTags"])
    text = files[listed["Config"]]
    assert listed["Config"] == f"{hashlib.sha256(text).hexdigest()}.json"
    configuration = json.loads(text)
    layers = [files[member] for member in listed["Layers"]]
    digests = [f"sha256:{hashlib.sha256(layer).hexdigest()}" for layer in layers]
    assert configuration["rootfs"]["diff_ids"] == digests
    return configuration, layers


def base(time_s: int = BUILT_S, uname: str = "") -> bytes:
    return tar(
        entry("etc", type=tarfile.DIRTYPE, mode=0o755, mtime=time_s),
        entry("etc/passwd", b"root", mtime=time_s, uname=uname, gname=uname),
    )


def own(time_s: float = BUILT_S, content: bytes = b"robot") -> bytes:
    return tar(entry("opt/robot", content, mtime=time_s, mode=0o755))


def test_two_builds_of_the_same_files_are_the_same_bytes(tmp_path: Path) -> None:
    first = saved(
        tmp_path / "first",
        Image("gateway", [base(), own()], labels={"title": "gateway", "com.docker.compose.version": "2.26"}),
        Image("drive", [base(), own(), tar()], labels={"title": "drive"}),
    )
    later = [base(LATER_S, "root"), own(LATER_S + 0.5)]
    project = {"com.docker.compose.project": "lab7"}
    second = saved(
        tmp_path / "second",
        Image("drive", [*later, tar()], "2026-11-29T00:00:00Z", {"title": "drive"}),
        Image("gateway", later, "2026-11-29T00:00:01Z", {**project, "title": "gateway"}),
        time_s=LATER_S,
        compressed=True,
    )
    assert written(first) == written(second)
    assert written(first, None) != written(second, None)


def test_another_content_is_another_image(tmp_path: Path) -> None:
    first = saved(tmp_path / "first", Image("gateway", [own()]))
    second = saved(tmp_path / "second", Image("gateway", [own(content=b"other")]))
    assert written(first) != written(second)


def test_an_image_gets_its_time_and_loses_what_is_of_its_builder(tmp_path: Path) -> None:
    labels = {"title": "gateway", "com.docker.compose.project": "lab7"}
    image = Image("gateway", [base(), own()], labels=labels)
    configuration, _ = image_of(written(saved(tmp_path / "saved", image)), "gateway")
    assert configuration["created"] == "2026-01-02T03:04:05Z"
    assert [step["created"] for step in configuration["history"]] == ["2026-01-02T03:04:05Z"] * 2
    assert configuration["config"] == {
        "User": "10005:10000",
        "Labels": {"title": "gateway"},
        "Cmd": ["robot"],
    }


def test_images_share_the_layers_that_they_shared(tmp_path: Path) -> None:
    images = [Image(name, [base(), own(content=name.encode())]) for name in ("gateway", "drive", "recorder")]
    files = contents(written(saved(tmp_path / "saved", *images)))
    assert len([name for name in files if name.endswith(".tar")]) == 4


@pytest.mark.parametrize("compressed", [False, True])
def test_without_a_time_images_stay_what_they_are(tmp_path: Path, compressed: bool) -> None:
    image, other = Image("gateway", [base(), own()]), Image("drive", [base()])
    archive = written(saved(tmp_path / "saved", image, other, compressed=compressed), None)
    _, layers = image_of(archive, "gateway")
    assert layers == list(image.layers)
    assert image.configuration() in contents(archive).values()
    assert archive == written(saved(tmp_path / "other", other, image, time_s=LATER_S), None)


@pytest.mark.parametrize("compressed", [False, True], ids=["classic store", "containerd store"])
def test_an_oci_layout_is_read_as_the_same_images(tmp_path: Path, compressed: bool) -> None:
    images = Image("gateway", [base(), own()]), Image("drive", [base()])
    layout = saved_as_oci_layout(tmp_path / "layout", *images, compressed=compressed)
    assert written(layout) == written(saved(tmp_path / "saved", *images))
    assert written(layout, None) == written(tmp_path / "saved", None)


def test_an_image_without_layers_is_read(tmp_path: Path) -> None:
    """In Go an empty list may be null."""
    configuration = json.dumps({"config": None, "rootfs": {"type": "layers", "diff_ids": None}}).encode()
    manifest = [{"Config": "one.json", "RepoTags": None, "Layers": None}]
    listed = entry("manifest.json", json.dumps(manifest).encode())
    (tmp_path / "saved").write_bytes(tar(entry("one.json", configuration), listed))
    assert configuration in contents(written(tmp_path / "saved", None)).values()
    (written_manifest,) = json.loads(contents(written(tmp_path / "saved"))["manifest.json"])
    assert (written_manifest["RepoTags"], written_manifest["Layers"]) == ([], [])


def test_one_image_with_two_names_is_one_with_two_names(tmp_path: Path) -> None:
    image = Image("gateway", [base()])
    files = contents(written(saved(tmp_path / "saved", image, replace(image, name="latest"))))
    (listed,) = json.loads(files["manifest.json"])
    assert listed["RepoTags"] == ["gateway:1", "latest:1"]


def test_what_was_written_once_is_written_as_the_same_again(tmp_path: Path) -> None:
    once = written(saved(tmp_path / "saved", Image("gateway", [base(), own()])))
    (tmp_path / "again").write_bytes(once)
    assert written(tmp_path / "again") == once
    assert written(tmp_path / "again", None) == once


def test_files_keep_all_but_their_times(tmp_path: Path) -> None:
    """Names, links, devices, owners, modes, and extended attributes, which are no text."""
    capability = b"\x01\x00\x00\x02\x00\xff".decode("utf-8", "surrogateescape")
    long_name = f"opt/{'a' * 120}/{'b' * 120}"
    layer = tar(
        entry("tmp", type=tarfile.DIRTYPE, mode=0o1777, uid=10005, gid=10000),
        entry(long_name, b"x" * 1000, mode=0o4755, mtime=BUILT_S + 0.25),
        entry("usr/bin/ping", b"ping", pax_headers={"SCHILY.xattr.security.capability": capability}),
        entry("usr/bin/link", type=tarfile.SYMTYPE, linkname="ping"),
        entry("usr/bin/same", type=tarfile.LNKTYPE, linkname="usr/bin/ping"),
        entry("usr/share/.wh.doc"),
        entry("usr/share/man/.wh..wh..opq"),
        entry("usr/share/\udcff\u00e4", b"named", uid=3_000_000),
        entry("dev/null", type=tarfile.CHRTYPE, devmajor=1, devminor=3, mode=0o666),
        entry("dev/sda", type=tarfile.BLKTYPE, devmajor=8),
        entry("run/pipe", type=tarfile.FIFOTYPE),
        entry("of-a-type-that-tarfile-does-not-know", b"content", type=b"V"),
        entry("last", b"last"),
    )
    _, (normalized,) = image_of(written(saved(tmp_path / "saved", Image("gateway", [layer]))), "gateway")
    with (
        tarfile.open(fileobj=io.BytesIO(layer)) as before,
        tarfile.open(fileobj=io.BytesIO(normalized)) as after,
    ):
        kept = ("name", "devmajor", "devminor", "mode", "uid", "gid", "type", "linkname", "size")
        assert [[getattr(each, name) for name in kept] for each in after.getmembers()] == [
            [getattr(each, name) for name in kept] for each in before.getmembers()
        ]
        assert {each.mtime for each in after.getmembers()} == {FILE_TIME_S}
        assert after.getmember("usr/bin/ping").pax_headers["SCHILY.xattr.security.capability"] == capability
    assert contents(normalized) == contents(layer)
    _, again = image_of(written(saved(tmp_path / "again", Image("gateway", [normalized]))), "gateway")
    assert again == [normalized]


@pytest.mark.parametrize("form", ["gnu", "pax"])
def test_a_file_with_holes_keeps_its_content(tmp_path: Path, form: str) -> None:
    with (tmp_path / "holes").open("wb") as file:
        file.write(b"begin")
        file.seek(1 << 20)
        file.write(b"end")
    (tmp_path / "next").write_text("next")
    layer = subprocess.run(
        ["tar", "--sparse", f"--format={form}", "-c", "-C", tmp_path, "holes", "next"],
        capture_output=True,
        timeout=30,
        check=True,
    ).stdout
    assert len(layer) < 1 << 20
    _, (normalized,) = image_of(written(saved(tmp_path / "saved", Image("gateway", [layer]))), "gateway")
    assert contents(normalized) == {
        "holes": b"begin" + bytes((1 << 20) - 5) + b"end",
        "next": b"next",
    }
    with tarfile.open(fileobj=io.BytesIO(normalized)) as archive:
        assert not [each.name for each in archive if each.issparse()]


def test_names_are_the_same_bytes_in_any_language(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """GNU tar's format does not say how a name is encoded; tarfile takes the computer's encoding."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.GNU_FORMAT, encoding="utf-8") as archive:
        archive.addfile(entry("usr/share/\u00e4")[0])
    file = saved(tmp_path / "saved", Image("gateway", [packed.getvalue()]))
    expected = written(file)
    monkeypatch.setattr(tarfile.TarFile, "encoding", "iso8859-1")
    assert written(file) == expected
    monkeypatch.undo()
    _, (normalized,) = image_of(expected, "gateway")
    assert list(contents(normalized)) == ["usr/share/\u00e4"]


def compiled(directory: Path, mode: py_compile.PycInvalidationMode, *, stale: bool = False) -> bytes:
    """A layer with a module and what Python has compiled of it."""
    source = directory / "module.py"
    source.write_text("print('source')\n")
    os.utime(source, (BUILT_S, BUILT_S))
    cached = directory / "module.pyc"
    py_compile.compile(str(source), str(cached), doraise=True, invalidation_mode=mode)
    return tar(
        entry("lib/module.py", source.read_bytes(), mtime=BUILT_S + (7 if stale else 0.5)),
        entry(importlib.util.cache_from_source("lib/module.py"), cached.read_bytes()),
    )


@pytest.mark.parametrize(
    ("mode", "stale", "taken"),
    [
        (py_compile.PycInvalidationMode.TIMESTAMP, False, True),
        (py_compile.PycInvalidationMode.TIMESTAMP, True, False),
        (py_compile.PycInvalidationMode.CHECKED_HASH, False, True),
        (py_compile.PycInvalidationMode.UNCHECKED_HASH, False, True),
    ],
)
def test_python_takes_a_compiled_module_as_it_did_before(
    tmp_path: Path, mode: py_compile.PycInvalidationMode, stale: bool, taken: bool
) -> None:
    layer = compiled(tmp_path, mode, stale=stale)
    _, (normalized,) = image_of(written(saved(tmp_path / "saved", Image("gateway", [layer]))), "gateway")
    (tmp_path / "image").mkdir()
    subprocess.run(["tar", "-x", "-C", tmp_path / "image"], input=normalized, timeout=30, check=True)
    ended = subprocess.run(
        [sys.executable, "-v", "-c", "import module"],
        env={"PYTHONPATH": str(tmp_path / "image/lib"), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=30,
        check=True,
    )
    assert ended.stdout == "source\n"
    (cached,) = (tmp_path / "image").rglob("*.pyc")
    assert (f"code object from {str(cached)!r}" in ended.stderr) is taken


def test_a_compiled_module_does_not_name_the_time_of_the_build(tmp_path: Path) -> None:
    layer = compiled(tmp_path, py_compile.PycInvalidationMode.TIMESTAMP)
    _, (normalized,) = image_of(written(saved(tmp_path / "saved", Image("gateway", [layer]))), "gateway")
    assert BUILT_S.to_bytes(4, "little") in layer
    assert BUILT_S.to_bytes(4, "little") not in normalized


@pytest.mark.parametrize("created", [None, CREATED])
def test_a_damaged_layer_is_not_passed_on(tmp_path: Path, created: datetime | None) -> None:
    file = saved(tmp_path / "saved", Image("gateway", [own()]))
    file.write_bytes(file.read_bytes().replace(b"robot\x00", b"rebot\x00"))
    with pytest.raises(UserError, match=r"^the layer sha256:[0-9a-f]{64} is damaged"):
        written(file, created)


def test_a_header_that_can_not_be_read_does_not_end_a_layer(tmp_path: Path) -> None:
    """To tarfile it is the end of the archive: what follows would be lost."""
    layer = bytearray(base())
    assert layer[512:].startswith(b"etc/passwd")
    layer[512 + 148] ^= 1  # of the checksum
    file = saved(tmp_path / "saved", Image("gateway", [bytes(layer)]))
    with pytest.raises(tarfile.ReadError, match="the header at byte 512 "):
        written(file)


def test_a_compression_that_can_not_be_read_is_named(tmp_path: Path) -> None:
    file = saved(tmp_path / "saved", Image("gateway", [b"\x28\xb5\x2f\xfd and more"]))
    with pytest.raises(UserError, match=r"is compressed with zstd.*gzip"):
        written(file, None)


def assert_named(ended: subprocess.CompletedProcess[bytes]) -> None:
    assert (ended.returncode, ended.stdout) == (1, b"")
    assert ended.stderr.startswith(b"images: ")
    assert len(ended.stderr.splitlines()) == 1


def program(file: Path, *options: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "image_archive", file, *options],
        env={**os.environ, "PYTHONPATH": f"{ROOT}/scripts:{ROOT}"},
        capture_output=True,
        timeout=30,
        check=False,
    )


def test_the_program_writes_the_archive(tmp_path: Path) -> None:
    file = saved(tmp_path / "saved", Image("gateway", [own()]))
    assert program(file).stdout == written(file, None)
    assert program(file, "--created", "1767323045").stdout == written(file)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "No such file"),
        (b"no archive", "images: "),
        (tar(), "has no file manifest.json"),
        (
            tar(entry("manifest.json", type=tarfile.SYMTYPE, linkname="manifest.json")),
            "has no file manifest.json",
        ),
        (tar(entry("manifest.json", b"no list")), "describes no images"),
        (tar(entry("manifest.json", b"[{}]")), "describes no images"),
        (tar(entry("manifest.json", b"[" * 100_000)), "describes no images"),
    ],
    ids=["missing", "no archive", "empty", "circular", "no list", "no image", "nested"],
)
def test_what_is_no_archive_of_images_is_named_in_one_line(
    tmp_path: Path, content: bytes | None, said: str
) -> None:
    file = tmp_path / "saved"
    if content is not None:
        file.write_bytes(content)
    ended = program(file)
    assert_named(ended)
    assert said in ended.stderr.decode()


def test_a_manifest_without_end_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "saved").write_bytes(tar(entry("manifest.json", b" " * (1 + (16 << 20)))))
    with pytest.raises(UserError, match=r"^manifest.json .* more than 16777216 bytes"):
        written(tmp_path / "saved")


@pytest.mark.parametrize("options", [[], ["--created", "1767323045"]], ids=["as they are", "with a time"])
def test_an_archive_that_ends_too_early_is_named_in_one_line(tmp_path: Path, options: list[str]) -> None:
    file = saved(tmp_path / "saved", Image("gateway", [base(), own()]))
    os.truncate(file, 8000)
    assert_named(program(file, *options))


@pytest.mark.parametrize("options", [[], ["--created", "1767323045"]], ids=["as they are", "with a time"])
def test_a_compressed_layer_that_is_damaged_is_named_in_one_line(tmp_path: Path, options: list[str]) -> None:
    file = saved(tmp_path / "saved", Image("gateway", [own()]), compressed=True)
    whole = file.read_bytes()
    start = whole.index(b"\x1f\x8b")
    file.write_bytes(whole[: start + 40] + bytes(40) + whole[start + 80 :])
    assert_named(program(file, *options))
