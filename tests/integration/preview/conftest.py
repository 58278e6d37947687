"""A service per test."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.running_preview import RunningPreview


@pytest.fixture
def preview(tmp_path: Path) -> Iterator[RunningPreview]:
    """A service with a test pattern and x264."""
    with RunningPreview(tmp_path) as preview:
        yield preview
