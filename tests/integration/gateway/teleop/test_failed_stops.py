"""What a stall may explain of a robot that is driven and stopped is a failed assertion, in one form."""

import re
from pathlib import Path
from typing import Any, Self, cast

import pytest

from console.client import GatewayError
from tests.support import shared_robot as shared


class _Client:
    """Of a robot that no call reaches."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        pass


@pytest.mark.parametrize(
    "error", [GatewayError("the session has ended"), AssertionError("not within 15 s: the base has zero")]
)
async def test_it_says_what_was_done(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """The defect: which of the two comes of a stall is chance, and one test took the first one only."""

    async def fail(_client: _Client) -> None:
        raise error

    monkeypatch.setattr(shared, "AsyncGatewayClient", _Client)
    monkeypatch.setattr(shared, "make_available", fail)
    none = cast("Any", None)
    robot = shared.SharedRobot("robot:1", none, none, none, none, Path("crowd.login"))
    with pytest.raises(AssertionError, match=re.escape(f"driven and stopped: {error}")):
        await robot.stops(1)
