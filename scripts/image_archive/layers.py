"""Layers of images: tar archives of the files that a build step has changed."""

import importlib.util
import struct
import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Final, Protocol

FILE_TIME_S: Final = 315532800
"""1980-01-01, the earliest that a zip archive can hold.

Not the commit's: a layer whose files are the same in two releases is one layer, which a robot stores once.
"""
_PYC_HEADER: Final = struct.Struct("<4sIII")
"""Magic number, flags, the source's time and size (PEP 552); with flags, a hash in place of the last two."""
_CHUNK_BYTES: Final = 1 << 20
_END: Final = bytes(2 * tarfile.BLOCKSIZE)
_NOT_KEPT: Final = frozenset({"atime", "ctime", "hdrcharset", *tarfile.PAX_FIELDS})
"""Records of extended headers: further times, and what `TarInfo.tobuf` writes where a field needs it."""
_OF_SPARSE_FILES: Final = "GNU.sparse."


class Sink(Protocol):
    """What a layer is written to."""

    def write(self, data: bytes, /) -> object:
        """Takes all of it."""


def copy(layer: IO[bytes], sink: Sink) -> None:
    """Copies a layer as it is."""
    while chunk := layer.read(_CHUNK_BYTES):
        sink.write(chunk)


def normalize(layer: IO[bytes], sink: Sink) -> None:
    """Copies a layer with FILE_TIME_S as the time of all files, and without names of users and groups.

    A compiled Python module names the time of its source; Python ignores it when the source has another one.
    It gets FILE_TIME_S, too, if it was valid before and its source is in the same layer.

    The memory that this takes depends on the number of files, not on their size.

    Args:
        layer: a tar archive; seekable, because it is read twice.
        sink: gets the new one.

    Raises:
        tarfile.TarError: the layer is no tar archive, ends too early, or has a header that can't be read.
    """
    sources = _times_of_sources(layer)
    layer.seek(0)
    with _reading(layer) as archive:
        for member in archive:
            content = archive.extractfile(member) if _has_content(member) else None
            head = content.read(_PYC_HEADER.size) if content else b""
            if _is_current(member.name, head, sources):
                magic, flags, _, size = _PYC_HEADER.unpack(head)
                head = _PYC_HEADER.pack(magic, flags, FILE_TIME_S, size)
            sink.write(_header(member))
            if content:
                sink.write(head)
                copy(content, sink)
                sink.write(bytes(-member.size % tarfile.BLOCKSIZE))
    sink.write(_END)


@contextmanager
def _reading(layer: IO[bytes]) -> Iterator[tarfile.TarFile]:
    # Not in the encoding of this computer's language: the names have to stay the same bytes.
    with tarfile.open(fileobj=layer, mode="r|", encoding="utf-8", errors="surrogateescape") as archive:
        yield archive


def _times_of_sources(layer: IO[bytes]) -> dict[str, int]:
    """Returns the time of each Python source, and reads the layer to its end."""
    with _reading(layer) as archive:
        times = {each.name: int(each.mtime) for each in archive if each.name.endswith(".py")}
    # To tarfile a header that it can't read is the end, without an error: the files behind it would be lost.
    layer.seek(archive.offset)
    if layer.read(tarfile.BLOCKSIZE).strip(b"\0"):
        raise tarfile.ReadError(f"the header at byte {archive.offset} of a layer can't be read")
    return times


def _has_content(member: tarfile.TarInfo) -> bool:
    """Returns whether bytes follow the header; tarfile skips them also after types that it does not know."""
    return member.isreg() or member.type not in tarfile.SUPPORTED_TYPES


def _is_current(name: str, head: bytes, sources: Mapping[str, int]) -> bool:
    """Returns whether this is a compiled module that names the time of its source."""
    if not name.endswith(".pyc") or len(head) < _PYC_HEADER.size:
        return False
    _, flags, time_s, _ = _PYC_HEADER.unpack(head)
    try:
        source = importlib.util.source_from_cache(name)
    except ValueError:  # It is beside its source, or has none: Python compares no times.
        return False
    return not flags and sources.get(source) == time_s


def _header(member: tarfile.TarInfo) -> bytes:
    member.mtime = FILE_TIME_S
    member.uname = member.gname = ""
    if member.issparse():  # Its holes are written as what they are read as, zeros.
        member.type = tarfile.REGTYPE
    member.pax_headers = {
        name: value
        for name, value in member.pax_headers.items()
        if name not in _NOT_KEPT and not name.startswith(_OF_SPARSE_FILES)
    }
    return member.tobuf(tarfile.PAX_FORMAT, "utf-8", "surrogateescape")
