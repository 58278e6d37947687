"""Lock files, read for one Python; every entry keeps its hashes."""

from pathlib import Path

import pytest
from release_program.wheelhouse import SOURCE_ONLY, read_lock

from common.errors import UserError

ROOT = Path(__file__).parents[3]
LOCK = """# sha256 of the requirements and of the lines below, by scripts/lock: 00
grpcio==1.85.1 \\
    --hash=sha256:aa \\
    --hash=sha256:bb
    # via
    #   robot-gateway (pyproject.toml)
numpy==2.4 ; python_full_version < '3.12' \\
    --hash=sha256:cc
    # via mcap
colorama==0.4.6 ; sys_platform == 'win32' \\
    --hash=sha256:dd
"""


def test_entries_keep_version_and_hashes_without_their_comments() -> None:
    assert [entry.line() for entry in read_lock(LOCK)] == [
        "grpcio==1.85.1 --hash=sha256:aa --hash=sha256:bb",
        "numpy==2.4 --hash=sha256:cc",
        "colorama==0.4.6 --hash=sha256:dd",
    ]


@pytest.mark.parametrize(("python", "names"), [("3.11", ["grpcio", "numpy"]), ("3.12", ["grpcio"])])
def test_conditions_are_those_of_the_target_not_of_this_computer(python: str, names: list[str]) -> None:
    assert [
        entry.requirement.name for entry in read_lock(LOCK) if entry.applies_to(python, "x86_64")
    ] == names


@pytest.mark.parametrize(
    "text", ["grpcio==1.85.1\n", "git+https://example.org/x --hash=sha256:aa\n", "==1\n"]
)
def test_an_entry_without_a_hash_or_a_name_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="scripts/lock"):
        list(read_lock(text))


def test_the_consoles_lock_file_can_be_read() -> None:
    entries = list(read_lock((ROOT / "requirements/console.txt").read_text(encoding="utf-8")))
    assert {entry.requirement.name for entry in entries} > SOURCE_ONLY
    assert all(entry.hashes for entry in entries)
