"""Pages of names: each file on one of them, none too large to be sent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InvalidRequestError
from recorder.rpc.file_pages import MOST_BYTES, MOST_FILES, file_page


def pages(names: list[str]) -> list[list[str]]:
    found, token = [], ""
    while True:
        page = file_page(names, token)
        found.append([names[at] for at in page.files])
        if not (token := page.next_token):
            return found


@given(st.integers(0, 3 * MOST_FILES))
def test_every_file_is_on_one_page_in_order(count: int) -> None:
    names = [str(number) for number in range(count)]
    found = pages(names)
    assert [name for page in found for name in page] == names
    assert all(len(page) == MOST_FILES for page in found[:-1])


def test_a_page_of_long_names_stays_small_enough_to_be_sent() -> None:
    names = [f"{number:06}{'ü' * 249}" for number in range(MOST_FILES)]
    found = pages(names)
    assert [name for page in found for name in page] == names
    assert len(found) > 1
    assert all(len("".join(page).encode()) <= MOST_BYTES for page in found)


def test_a_name_longer_than_a_page_is_a_page() -> None:
    assert pages(["a" * (MOST_BYTES + 1), "b"]) == [["a" * (MOST_BYTES + 1)], ["b"]]


def test_files_that_are_added_meanwhile_move_none() -> None:
    names = [str(number) for number in range(MOST_FILES + 1)]
    token = file_page(names, "").next_token
    assert file_page(["earlier", *names], token).files == range(MOST_FILES + 1, MOST_FILES + 2)


def test_a_token_of_no_file_is_refused() -> None:
    with pytest.raises(InvalidRequestError, match="page_token is none"):
        file_page(["a"], "b")
