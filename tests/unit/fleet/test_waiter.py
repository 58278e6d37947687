"""What waits for a caller is bounded, whatever the hub sends."""

import pytest

from fleet.errors import HubError, HubReason, UnreachableError
from fleet.replies import Message, Waiter


def _message(size: int) -> Message:
    return Message("", b"x" * size, {}, "")


async def test_bytes_are_bounded_and_freed() -> None:
    waiter = Waiter("subject")
    for _ in range(20):
        waiter.take(_message(1024 * 1024))
    assert waiter.replies.qsize() == 8
    await waiter.get(1)
    waiter.take(_message(1024 * 1024))
    assert waiter.replies.qsize() == 8


async def test_messages_are_bounded() -> None:
    waiter = Waiter("subject")
    for _ in range(10_000):
        waiter.take(_message(0))
    assert waiter.replies.qsize() == 4096


async def test_a_lost_connection_ends_the_waiting() -> None:
    waiter = Waiter("subject")
    waiter.replies.put_nowait(UnreachableError("lost"))
    with pytest.raises(UnreachableError):
        await waiter.get(1)
    with pytest.raises(HubError) as late:
        await waiter.get(0.01)
    assert late.value.reason is HubReason.TIMEOUT
