"""robotctl starts fast because it imports late: what a command line imports is read from its process."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from console.cli.app import COMMANDS, command_line
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment

ROOT = Path(__file__).parents[2]
REPORTING = """
import atexit, gc, json, sys
def report():
    collector = [gc.isenabled(), gc.get_freeze_count(), len(gc.get_objects())]
    print(json.dumps({"modules": sorted(sys.modules), "collector": collector}), file=sys.stderr)
atexit.register(report)
from console.cli import main
main()
"""
WINDOWS = {"gi", "PySide6", "numpy", "pydantic", "rclpy", "sdl2"}
FOR_TABLES = {"rich"}
FOR_CALLS = {"grpc", "google", "asyncio", "omniseer"}
FOR_EDITS = {"tomlkit"}
FOR_VERSIONS = {"email"}


def report_of(*words: str, **extra: str) -> Any:
    """What a command line's process reports when it ends with 0."""
    ran = subprocess.run(
        [sys.executable, "-c", REPORTING, *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(**extra),
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stderr.splitlines()[-1])


def imported_by(*words: str, **extra: str) -> set[str]:
    """The packages that a command line has imported when it ends with 0."""
    return {name.partition(".")[0] for name in report_of(*words, **extra)["modules"]}


def test_help_imports_neither_grpc_nor_rich() -> None:
    assert not imported_by("--help") & (WINDOWS | FOR_TABLES | FOR_CALLS | FOR_EDITS)


def test_completion_imports_no_more_than_help() -> None:
    extra = {"_ROBOTCTL_COMPLETE": "complete_bash", "COMP_WORDS": "robotctl pre", "COMP_CWORD": "1"}
    assert not imported_by(**extra) & (WINDOWS | FOR_TABLES | FOR_CALLS | FOR_EDITS)


@pytest.mark.parametrize("words", [("status",), ("overlay",), ("preview", "on"), ("watch", "--count", "1")])
def test_a_command_for_the_terminal_imports_nothing_for_windows_or_versions(words: tuple[str, ...]) -> None:
    with serving(GatewayDouble()) as port:
        imported = imported_by(*words, "--target", f"127.0.0.1:{port}")
    assert "grpc" in imported
    assert not imported & (WINDOWS | FOR_EDITS | FOR_VERSIONS)


@pytest.mark.parametrize("words", [("--help",), ("status", "--help"), ("status",)])
def test_garbage_is_collected_but_not_looked_for_among_imports(words: tuple[str, ...]) -> None:
    with serving(GatewayDouble()) as port:
        collects, kept, others = report_of("--target", f"127.0.0.1:{port}", *words)["collector"]
    assert collects
    assert kept > others


@pytest.mark.parametrize("name", list(COMMANDS))
def test_the_help_of_all_commands_has_the_first_line_of_each(name: str) -> None:
    stand_in = command_line().commands[name]
    lines = (stand_in.load().help or "").splitlines()  # type: ignore[attr-defined]  # a LazyCommand
    assert stand_in.short_help == lines[0]


def test_the_installed_program_shows_every_command() -> None:
    shown = subprocess.run(
        [ROBOTCTL, "--help"], capture_output=True, text=True, check=True, env=environment()
    )
    for name, (_, summary) in COMMANDS.items():
        assert f"\n  {name} " in shown.stdout
        assert summary.split()[-1] in shown.stdout
