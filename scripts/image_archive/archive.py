"""The archive of images: read as `docker save` writes it, written in one form."""

import gzip
import hashlib
import io
import json
import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Final

from common.errors import UserError
from image_archive import layers
from image_archive.layers import FILE_TIME_S, Sink

_MANIFEST: Final = "manifest.json"
_TEXT_BYTES: Final = 16 << 20
"""The largest manifest or configuration that is read; real ones have some KiB."""
_LABELS_OF_COMPOSE: Final = "com.docker.compose."
"""They name its version, and the project of the computer that built the image."""
_GZIP_MAGIC: Final = b"\x1f\x8b"
_ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"


class _Measure:
    """Counts and hashes what is written to it."""

    def __init__(self) -> None:
        self.size = 0
        self._hash = hashlib.sha256()

    def write(self, data: bytes, /) -> None:
        self.size += len(data)
        self._hash.update(data)

    @property
    def digest(self) -> str:
        """The SHA-256 in hexadecimal digits."""
        return self._hash.hexdigest()


@dataclass(frozen=True, slots=True)
class _Image:
    """An image of the archive that is read.

    Attributes:
        configuration: in JSON.
        layers: the digest of each, without compression, and its name in the archive.
        tags: names of the image.
    """

    configuration: bytes
    layers: list[tuple[str, str]]
    tags: list[str]


@dataclass(frozen=True, slots=True)
class _Layer:
    """A layer of the archive.

    Attributes:
        member: its name in the archive that is read.
        digest: the SHA-256 of what is written.
        size: of the same, in bytes.
    """

    member: str
    digest: str
    size: int


def write(saved: Path, sink: Sink, created: datetime | None) -> None:
    """Writes the images of an archive as a new one.

    Args:
        saved: written by `docker save`.
        sink: gets the new archive.
        created: the new time of the images, in UTC. Their files then get one time as well, so that the same
            files make the same images. None: the images stay as they are.

    Raises:
        UserError: the archive lacks something, or an image in it is damaged.
        tarfile.TarError: it is no tar archive, or ends too early.
        EOFError: a compressed layer ends too early.
        zlib.error: a compressed layer is damaged.
    """
    with tarfile.open(saved, "r:") as archive:
        written: dict[str, _Layer] = {}  # by the digest before
        configurations: dict[str, bytes] = {}  # by their digest, which is the image's ID
        listed: dict[str, dict[str, Any]] = {}  # the same
        for image in _images(archive):
            for digest, member in image.layers:
                if digest not in written:
                    written[digest] = _measured(archive, member, digest, normalized=created is not None)
            own = [written[digest] for digest, _ in image.layers]
            text = _normalized(image.configuration, created, own) if created else image.configuration
            identity = hashlib.sha256(text).hexdigest()
            configurations[identity] = text
            entry = listed.setdefault(identity, {"Config": f"{identity}.json", "RepoTags": [], "Layers": []})
            entry["Layers"] = [f"{layer.digest}.tar" for layer in own]
            entry["RepoTags"] = sorted({*entry["RepoTags"], *image.tags})
        manifest = sorted(listed.values(), key=lambda entry: (entry["RepoTags"], entry["Config"]))
        _write_file(sink, _MANIFEST, _json(manifest))
        for identity, text in sorted(configurations.items()):
            _write_file(sink, f"{identity}.json", text)
        for layer in sorted({layer.digest: layer for layer in written.values()}.values(), key=_digest):
            sink.write(_header(f"{layer.digest}.tar", layer.size))
            _write_layer(archive, layer.member, sink, normalized=created is not None)
            sink.write(_padding(layer.size))
        sink.write(bytes(2 * tarfile.BLOCKSIZE))


def _digest(layer: _Layer) -> str:
    return layer.digest


def _images(archive: tarfile.TarFile) -> list[_Image]:
    images = []
    try:
        for listed in json.loads(_content(archive, _MANIFEST)):
            configuration = _content(archive, str(listed["Config"]))
            # An image without layers has null in place of each list.
            digests = map(str, json.loads(configuration)["rootfs"]["diff_ids"] or ())
            members = map(str, listed["Layers"] or ())
            tags = [str(tag) for tag in listed["RepoTags"] or ()]
            images.append(_Image(configuration, list(zip(digests, members, strict=True)), tags))
    except (KeyError, RecursionError, TypeError, ValueError) as error:
        raise UserError(f"the archive of docker save describes no images: {error!r}") from error
    return images


def _content(archive: tarfile.TarFile, name: str) -> bytes:
    with _opened(archive, name) as file:
        content = file.read(_TEXT_BYTES + 1)
    if len(content) > _TEXT_BYTES:
        raise UserError(f"{name} in the archive of docker save has more than {_TEXT_BYTES} bytes")
    return content


@contextmanager
def _opened(archive: tarfile.TarFile, name: str) -> Iterator[IO[bytes]]:
    """Opens a file of the archive, whose name may be that of a link to it."""
    try:
        file = archive.extractfile(name)
    except (KeyError, RecursionError):  # The second of a link that leads to itself.
        file = None
    if file is None:
        raise UserError(f"the archive of docker save has no file {name}")
    with file:
        yield file


def _measured(archive: tarfile.TarFile, member: str, digest: str, *, normalized: bool) -> _Layer:
    """Returns what will be written of a layer, which has to have its digest."""
    measure = _Measure()
    _write_layer(archive, member, measure, normalized=False)
    if f"sha256:{measure.digest}" != digest:
        raise UserError(f"the layer {digest} is damaged: its SHA-256 is {measure.digest}")
    if normalized:
        measure = _Measure()
        _write_layer(archive, member, measure, normalized=True)
    return _Layer(member, measure.digest, measure.size)


def _write_layer(archive: tarfile.TarFile, member: str, sink: Sink, *, normalized: bool) -> None:
    with _opened(archive, member) as file:
        start = file.read(len(_ZSTD_MAGIC))
        if start == _ZSTD_MAGIC:
            raise UserError(
                f"the layer {member} is compressed with zstd, which can't be read here",
                "Use a base image whose layers are compressed with gzip",
            )
        file.seek(0)
        # An engine with containerd's store keeps them as they came from a registry.
        compressed = start.startswith(_GZIP_MAGIC)
        layer = io.BufferedReader(gzip.GzipFile(fileobj=file)) if compressed else file
        (layers.normalize if normalized else layers.copy)(layer, sink)


def _normalized(text: bytes, created: datetime, own: list[_Layer]) -> bytes:
    """Returns an image's configuration with this time and these layers, without Compose's labels."""
    configuration: dict[str, Any] = json.loads(text)
    time = created.strftime("%Y-%m-%dT%H:%M:%SZ")
    configuration["created"] = time
    for step in configuration.get("history") or ():
        step["created"] = time
    configuration["rootfs"]["diff_ids"] = [f"sha256:{layer.digest}" for layer in own]
    process: dict[str, Any] = configuration.get("config") or {}
    labels: Mapping[str, str] = process.get("Labels") or {}
    if labels:
        process["Labels"] = {
            name: value for name, value in labels.items() if not name.startswith(_LABELS_OF_COMPOSE)
        }
    return _json(configuration)


def _json(value: object) -> bytes:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode()


def _write_file(sink: Sink, name: str, content: bytes) -> None:
    sink.write(_header(name, len(content)) + content + _padding(len(content)))


def _header(name: str, size: int) -> bytes:
    info = tarfile.TarInfo(name)
    info.size = size
    info.mtime = FILE_TIME_S
    return info.tobuf(tarfile.PAX_FORMAT)


def _padding(size: int) -> bytes:
    return bytes(-size % tarfile.BLOCKSIZE)
