"""The list of long files is kept up: a file that has moved would begin last."""

from pathlib import Path

import pytest

from tests.support.distribution import LONGEST

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("file", LONGEST)
def test_each_file_that_begins_early_exists(file: str) -> None:
    assert (ROOT / file).is_file()
