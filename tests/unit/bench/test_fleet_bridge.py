"""What the bridge takes is compared at a load that was there, with a publisher whose messages were taken."""

import pytest

from bench.fleet.bare_publisher import check_taken
from bench.fleet.bridge import check_arrived


@pytest.mark.parametrize("after", [(130, 34), (104, 60), (100, 30)])
def test_messages_that_did_not_come_have_no_figures(after: tuple[int, int]) -> None:
    with pytest.raises(RuntimeError, match="would mean nothing"):
        check_arrived((100, 30), after)


def test_one_that_is_under_way_at_the_end_is_no_matter() -> None:
    check_arrived((100, 30), (129, 61))


@pytest.mark.parametrize("answer", [b'{"error":{"code":400}}', b'{"stream":"e","error":{"code":400}}', b"{}"])
def test_an_error_of_the_hub_ends_the_bare_publisher(answer: bytes) -> None:
    """The defect: it counted as a message that was taken, and cost less than one."""
    with pytest.raises(RuntimeError, match="not taken"):
        check_taken(answer)


def test_an_acknowledgement_does_not() -> None:
    check_taken(b'{"stream":"e","seq":1}')
