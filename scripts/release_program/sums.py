"""SHA256SUMS: the SHA-256 of every file of a directory, as sha256sum(1) writes and checks it."""

import hashlib
from pathlib import Path
from typing import Final

NAME: Final = "SHA256SUMS"


def write_sums(directory: Path) -> None:
    """Writes SHA256SUMS over all other files below the directory, in the order of their paths."""
    files = sorted(path for path in directory.rglob("*") if path.is_file() and path != directory / NAME)
    lines = [f"{_sha256(path)}  {path.relative_to(directory).as_posix()}\n" for path in files]
    (directory / NAME).write_text("".join(lines), encoding="utf-8")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
