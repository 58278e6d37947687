"""Answers of a hub that wants the program to end, to grow, or to show what a terminal obeys."""

from typing import Any

import pytest

from fleet.consuming import delivery
from fleet.errors import HubError, HubReason, RefusedError, api_error
from fleet.replies import Message, NotTaken, Waiter, parsed


@pytest.mark.parametrize(
    "answer", [b'{"stream":' + b"[" * 200_000, b"[" * 200_000, b'{"a":' * 100_000, b"\xff", b"7", b""]
)
def test_an_answer_that_is_no_json_object_is_an_error(answer: bytes) -> None:
    with pytest.raises(HubError) as error:
        parsed(answer)
    assert error.value.reason is HubReason.INVALID


@pytest.mark.parametrize(
    "numbers", ["1.1.1." + "9" * 400 + ".0", "1.1.1." + "9" * 5000 + ".0", "1.1.x.1.0", "1.1.1", ""]
)
def test_a_delivery_with_impossible_numbers_is_an_error(numbers: str) -> None:
    session: Any = None
    message = Message("fleet.r1.cmd.c1", b"", {}, f"$JS.ACK.fleet_commands.r1.{numbers}")
    with pytest.raises(HubError) as error:
        delivery(session, message)
    assert error.value.reason is HubReason.INVALID


@pytest.mark.parametrize(
    "error",
    [
        api_error({"description": "\x1b]52;c;eA==\x07\r\n\ud800\u202e"}),
        HubError(HubReason.INVALID, "\ud800" * 5),
        RefusedError("x" * 1_000_000 + "\n"),
    ],
)
def test_words_of_the_hub_are_cut_and_printable(error: HubError) -> None:
    text = str(error)
    assert text.isprintable()
    assert 0 < len(text) <= 600
    text.encode()


async def test_headers_and_subjects_count_as_bytes_that_wait() -> None:
    not_taken = NotTaken()
    waiter = Waiter("subject", not_taken)
    for _ in range(100):
        waiter.take(Message("s" * 1024 * 1024, b"", {"Description": "d" * 1024 * 1024}, ""))
    assert waiter.replies.qsize() == 3
    assert not_taken.dropped == 97
    await waiter.get(1)
    waiter.take(Message("s" * 1024 * 1024, b"", {"Description": "d" * 1024 * 1024}, ""))
    assert waiter.replies.qsize() == 3


async def test_errors_that_a_hub_repeats_are_bounded() -> None:
    waiter = Waiter("subject")
    for _ in range(10_000):
        waiter.refuse(RefusedError("the credentials do not permit subject"))
    assert waiter.replies.qsize() == 4096
