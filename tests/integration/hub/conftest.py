"""What the tests of this folder share."""

import pytest


@pytest.fixture(autouse=True)
def patient_administration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has an administrator's commands wait for a server that stands still for as long as the machine does.

    What they promise in seconds, the tests with the mark `timed` measure themselves.
    """
    monkeypatch.setattr("hub.administration._PUSH_WITHIN_S", 30.0)
