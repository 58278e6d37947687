"""robotctl in the tests' own process: what it must leave alone."""

import ctypes
import os

import pytest

from common.errors import ExitCode
from tests.support import robotctl as support

LIBC = ctypes.CDLL(None)
LIBC.getenv.restype = ctypes.c_char_p


def test_its_environment_is_not_that_of_the_threads_of_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """They read it without a lock: a table that is replaced beneath them ends the whole process."""
    seen: list[tuple[str | None, bytes | None]] = []

    def exit_code() -> ExitCode:
        seen.append((os.getenv("ROBOTCTL_ROBOT"), LIBC.getenv(b"ROBOTCTL_ROBOT")))
        return ExitCode.DONE

    monkeypatch.setattr(support, "exit_code", exit_code)
    before = dict(os.environ)
    support.robotctl("status", ROBOTCTL_ROBOT="front")
    assert seen == [("front", None)]
    assert dict(os.environ) == before
    assert LIBC.getenv(b"PATH") == os.environb[b"PATH"]
