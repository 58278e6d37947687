"""Clients for tests that are not about their deadlines: a stall of the machine ends no call."""

from dataclasses import replace
from typing import Final

import pytest

from console.client import ClientOptions
from console.monitor import worker

PATIENT: Final = ClientOptions(
    answer_within_s=20.0, preview_within_s=20.0, connect_within_s=10.0, keepalive_within_s=20.0
)


def be_patient(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the workers of windows and viewers wait for a robot longer than a machine stands still.

    A test that measures time has the deadlines of the product.
    """
    if request.node.get_closest_marker("timed"):
        return
    options = replace(worker._OPTIONS, answer_within_s=4.0, connect_within_s=4.0)
    monkeypatch.setattr(worker, "_OPTIONS", options)
