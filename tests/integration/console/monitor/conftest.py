"""Every test here has Qt without a screen, and settings of its own."""

from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

from tests.support.patient import be_patient
from tests.support.qt import LIGHT, application, in_colours, own_settings

__all__ = ["application", "own_settings"]


@pytest.fixture(autouse=True)
def desk(
    application: QApplication,  # noqa: ARG001  # for its effect
    own_settings: Path,  # noqa: ARG001  # for its effect
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A light desktop without saved settings, and a patient worker."""
    in_colours(LIGHT)
    be_patient(request, monkeypatch)
