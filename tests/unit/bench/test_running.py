"""Parts of the benchmarks in processes of their own."""

import time
from pathlib import Path

import pytest

from bench import running
from bench.catalogue import Part
from bench.running import measured
from tests.support.processes import has_ended
from tests.support.waiting import wait_until


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Part:
    """A part whose group is a module `bench.example`, made by the test with `write`."""
    package = tmp_path / "bench"
    package.mkdir()
    for name in ("measure", "results", "rows", "__init__"):
        (package / f"{name}.py").symlink_to(Path(running.__file__).parent / f"{name}.py")
    monkeypatch.chdir(tmp_path)
    return Part("bench.example", 0.1, ("example.one", "example.two"))


def write(body: str) -> None:
    Path("bench/example.py").write_text(f"from bench.rows import Row\ndef run(names):\n    {body}\n")


def test_its_rows_come_back(part: Part) -> None:
    write("return [Row(name=n, what='w', unit='', values=[1.0] * 5, bar=2) for n in names]")
    assert [row.name for row in measured(part, ["example.two"])] == ["example.two"]


def test_one_that_fails_has_no_rows(part: Part, capfd: pytest.CaptureFixture[str]) -> None:
    write("raise RuntimeError('the machine is too busy')")
    assert measured(part, part.names) == []
    assert "bench.example: ended with 1" in capfd.readouterr().err


def test_one_that_crashes_has_no_rows(part: Part, capfd: pytest.CaptureFixture[str]) -> None:
    write("import os; os.abort()")
    assert measured(part, part.names) == []
    assert "bench.example: ended with -6" in capfd.readouterr().err


def test_one_that_hangs_is_ended_with_what_it_has_started(
    part: Part, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    # The shell ignores Ctrl-C, as programs do that hang.
    write("import subprocess; subprocess.run(['sh', '-c', 'trap \"\" INT; echo $$ > child; sleep 600'])")
    monkeypatch.setattr(running, "_MORE_MINUTES", 0.0)
    monkeypatch.setattr(running, "_PATIENCE", 2.0 / 60 / part.minutes)
    monkeypatch.setattr(running, "_END_WITHIN_S", 0.5)
    begun_s = time.monotonic()
    assert measured(part, part.names) == []
    assert time.monotonic() - begun_s < 30
    assert "bench.example: not done" in capfd.readouterr().err
    # Killed with its session, it is left to init.
    child = int(Path("child").read_text())
    wait_until(lambda: has_ended(child), "the child has ended")
