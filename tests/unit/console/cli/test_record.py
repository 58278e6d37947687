"""robotctl record: numbers that its requests can't carry."""

import pytest
from typer import BadParameter

from console.cli.app import command_line


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("start", "--max-duration", "5000000000"), "is not a whole number from 0 to 4294967295"),
        (("start", "--max-size", "18446744073710"), "is not a whole number from 0 to 18446744073709"),
        (("export", "20260101T000000Z-aaaaaa", "--limit", "1e300"), "is not a number from 0 to 1000000"),
        (("export", "20260101T000000Z-aaaaaa", "--limit", "inf"), "is not a number from 0 to 1000000"),
    ],
)
def test_a_number_that_no_request_can_carry_is_refused(words: tuple[str, ...], complaint: str) -> None:
    """The defect: a traceback."""
    with pytest.raises(BadParameter, match=complaint):
        command_line().main(["record", *words], standalone_mode=False)
