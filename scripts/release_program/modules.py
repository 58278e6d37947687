"""Which files a distribution needs: its entry packages, and every module of this project that those import.

Computed from the import statements, so that a new module needs no list changed. Knows no packaging.
"""

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

_BASES: Final = (PurePosixPath(), PurePosixPath("proto/python"))
"""Folders of a source tree in which top-level packages are found."""


@dataclass(frozen=True, slots=True, order=True)
class SourceFile:
    """A file of a distribution.

    Attributes:
        installed: relative to site-packages.
        source: relative to the source tree.
    """

    installed: PurePosixPath
    source: PurePosixPath


def closure(tree: Path, entries: Iterable[str]) -> frozenset[SourceFile]:
    """Returns the files of the entry packages, of what they import, and their stubs and data.

    An import inside a function counts like any other. What is no module of the tree comes from elsewhere.

    Args:
        tree: a source tree.
        entries: dotted names of modules, or of packages with everything below them.

    Raises:
        LookupError: an entry does not exist.
    """
    found: set[SourceFile] = set()
    waiting = [file for entry in entries for file in _entry_files(tree, entry)]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            for name in _imported(tree / file.source):
                waiting.extend(_with_parents(tree, name))
    return frozenset(found | set(_companions(tree, found)))


def _entry_files(tree: Path, entry: str) -> Iterator[SourceFile]:
    files = list(_with_parents(tree, entry))
    if not files or files[-1].installed.with_suffix("") not in (_path(entry), _path(entry) / "__init__"):
        raise LookupError(f"there is no module {entry} in {tree}")
    yield from files
    last = files[-1]
    if last.installed.name == "__init__.py":
        for path in sorted((tree / last.source).parent.rglob("*.py")):
            below = PurePosixPath(path.relative_to((tree / last.source).parent))
            yield SourceFile(last.installed.parent / below, last.source.parent / below)


def _with_parents(tree: Path, name: str) -> Iterator[SourceFile]:
    """Yields the module's packages, outermost first, and the module; names behind it are its attributes."""
    parts = name.split(".")
    for count in range(1, len(parts) + 1):
        path = _path(".".join(parts[:count]))
        candidates = (path / "__init__.py", path.with_name(f"{path.name}.py"))
        for base in _BASES:
            for installed in candidates:
                if (tree / base / installed).is_file():
                    yield SourceFile(installed, base / installed)


def _path(name: str) -> PurePosixPath:
    return PurePosixPath(*name.split("."))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                yield from (name.name for name in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield from (f"{module}.{name.name}" for name in names)


def _companions(tree: Path, modules: set[SourceFile]) -> Iterator[SourceFile]:
    """Yields the stubs of modules, and the data files of packages, each with its innermost package."""
    for module in modules:
        stub = module.source.with_suffix(".pyi")
        if (tree / stub).is_file():
            yield SourceFile(module.installed.with_suffix(".pyi"), stub)
        if module.installed.name != "__init__.py":
            continue
        folder = tree / module.source.parent
        for path in folder.rglob("*"):
            if path.is_file() and path.suffix not in (".py", ".pyi", ".pyc") and _package(path) == folder:
                below = PurePosixPath(path.relative_to(folder))
                yield SourceFile(module.installed.parent / below, module.source.parent / below)


def _package(path: Path) -> Path:
    """Returns the innermost package around a file."""
    return next(folder for folder in path.parents if (folder / "__init__.py").exists())
