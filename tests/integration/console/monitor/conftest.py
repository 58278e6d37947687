"""Every test here has Qt without a screen, and settings of its own."""

from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

from tests.support.qt import LIGHT, application, in_colours, own_settings

__all__ = ["application", "own_settings"]


@pytest.fixture(autouse=True)
def desk(application: QApplication, own_settings: Path) -> None:  # noqa: ARG001  # for their effects
    """A light desktop without saved settings."""
    in_colours(LIGHT)
