"""What a stall has spoilt is begun anew, what a defect has is not."""

import subprocess
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from tests.support.stalls import SPOILT_FROM_S
from tests.support.undisturbed import (
    ATTEMPTS,
    DisturbedError,
    no_stall,
    same_worker,
    undisturbed,
    undisturbed_async,
    without_stall,
)

SILENT = "no heartbeat of the worker for 61 ms, it waits for a processor: it is killed (exit code -9)"
CRASHED = "the worker has ended (exit code 1)"


@dataclass
class PlayedProgram:
    """A drive program whose worker does nothing, and whose guard logs what a test says."""

    worker: psutil.Process
    log: Path

    def says(self, *lines: str) -> None:
        with self.log.open("a", encoding="utf-8") as log:
            log.writelines(f"{line}\n" for line in lines)


@pytest.fixture
def program(tmp_path: Path) -> Iterator[PlayedProgram]:
    with subprocess.Popen(["sleep", "600"]) as process:
        program = PlayedProgram(psutil.Process(process.pid), tmp_path / "drive.log")
        program.says(CRASHED)  # of another worker, before
        yield program
        process.kill()


def test_what_fails_while_the_worker_lives_has_failed(program: PlayedProgram) -> None:
    def attempt() -> None:
        with same_worker(program):
            raise AssertionError

    with pytest.raises(AssertionError):
        undisturbed(attempt)


@pytest.mark.parametrize("fails", [True, False])
def test_what_a_worker_killed_for_its_silence_has_spoilt_is_begun_anew(
    program: PlayedProgram, fails: bool
) -> None:
    attempts = 0

    def attempt() -> int:
        nonlocal attempts
        attempts += 1
        if attempts > 1:
            return attempts
        with same_worker(program) as worker:
            worker.kill()
            # As the guard does: when the process has ended, which a test may notice before.
            threading.Timer(0.2, program.says, [SILENT]).start()
            assert not fails
        return 0

    with pytest.warns(UserWarning, match="the worker of the drive program was lost"):
        assert undisturbed(attempt) == 2


@pytest.mark.parametrize("error", [None, AssertionError("it stopped"), DisturbedError("it was at rest")])
@pytest.mark.parametrize("ends", [[CRASHED], [SILENT, CRASHED]], ids=["one", "the next"])
def test_a_worker_that_ends_by_itself_fails_the_test(
    program: PlayedProgram, error: Exception | None, ends: list[str]
) -> None:
    def attempt() -> None:
        with same_worker(program) as worker:
            worker.kill()
            program.says(*ends)
            if error:
                raise error

    with pytest.raises(
        AssertionError, match=r"ended by itself: the worker has ended \(exit code 1\)"
    ) as failed:
        undisturbed(attempt)
    assert failed.value.__cause__ is error


async def test_what_is_disturbed_again_and_again_fails() -> None:
    attempts = 0

    async def attempt() -> None:
        nonlocal attempts
        attempts += 1
        raise DisturbedError("it was at rest")

    with (
        pytest.warns(UserWarning, match="begun anew: it was at rest"),
        pytest.raises(pytest.fail.Exception, match="disturbed in all"),
    ):
        await undisturbed_async(attempt)
    assert attempts == ATTEMPTS


@pytest.fixture
def stalls(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """What is found of stalls."""
    found = SimpleNamespace(longest_s=0.0)
    monkeypatch.setattr("tests.support.undisturbed.Stalls", lambda: nullcontext(found))
    return found


def test_what_fails_in_a_stall_is_begun_anew(stalls: SimpleNamespace) -> None:
    stalls.longest_s = SPOILT_FROM_S
    with pytest.raises(DisturbedError, match="stood still"), no_stall():
        raise AssertionError
    with no_stall():
        pass


def test_each_attempt_has_a_directory_of_its_own(stalls: SimpleNamespace, tmp_path: Path) -> None:
    directories = []

    def attempt(directory: Path) -> Path:
        directories.append(directory)
        assert len(directories) > 1
        return directory

    stalls.longest_s = SPOILT_FROM_S
    with pytest.warns(UserWarning, match="stood still"):
        assert without_stall(attempt, tmp_path) == directories[1]
    assert {*directories} == {*tmp_path.iterdir()}
    assert len(directories) == 2


def test_what_fails_without_a_stall_has_failed(stalls: SimpleNamespace) -> None:
    stalls.longest_s = SPOILT_FROM_S - 0.001
    with pytest.raises(AssertionError), no_stall():
        raise AssertionError
