"""Open files of another user, without one: what fstat(2) says of them."""

import os

import pytest


def files_belong_to(user: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has every open file and directory belong to a user ID from now on."""
    fstat = os.fstat

    def of_that_user(handle: int) -> os.stat_result:
        found = list(fstat(handle))
        found[4] = user
        return os.stat_result(found)

    monkeypatch.setattr(os, "fstat", of_that_user)
