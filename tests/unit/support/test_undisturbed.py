"""What a stall has spoilt is begun anew, what a defect has is not."""

import subprocess
from collections.abc import Iterator

import psutil
import pytest

from tests.support.undisturbed import ATTEMPTS, DisturbedError, same_worker, undisturbed, undisturbed_async


@pytest.fixture
def worker() -> Iterator[psutil.Process]:
    with subprocess.Popen(["sleep", "600"]) as process:
        yield psutil.Process(process.pid)
        process.kill()


def test_what_fails_while_the_worker_lives_has_failed(worker: psutil.Process) -> None:
    def attempt() -> None:
        with same_worker(worker):
            raise AssertionError

    with pytest.raises(AssertionError):
        undisturbed(attempt)


@pytest.mark.parametrize("fails", [True, False])
def test_what_a_lost_worker_has_spoilt_is_begun_anew(worker: psutil.Process, fails: bool) -> None:
    attempts = 0

    def attempt() -> int:
        nonlocal attempts
        attempts += 1
        if attempts > 1:
            return attempts
        with same_worker(worker):
            worker.kill()
            assert not fails
        return 0

    with pytest.warns(UserWarning, match="the worker of the drive program was lost"):
        assert undisturbed(attempt) == 2


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
