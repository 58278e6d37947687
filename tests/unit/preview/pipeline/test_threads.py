"""Blocking calls in threads: what they return, raise and release."""

import threading
import weakref
from concurrent.futures import Future
from functools import partial
from typing import Any

import pytest

from preview.pipeline import threads
from preview.pipeline.threads import in_thread


class Element:
    """Something that a call references."""


async def test_a_result_and_an_error_come_back() -> None:
    assert await in_thread(lambda: 7, 5) == 7
    with pytest.raises(ZeroDivisionError):
        await in_thread(lambda: 1 // 0, 5)


async def test_a_call_that_does_not_return_is_given_up() -> None:
    returns = threading.Event()
    with pytest.raises(TimeoutError):
        await in_thread(returns.wait, 0.01)
    returns.set()


async def test_what_a_call_references_is_free_before_its_result_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the thread is not scheduled again for a while."""
    seen = threading.Event()

    class Preempted(Future[Any]):
        def set_result(self, result: Any) -> None:
            super().set_result(result)
            seen.wait(5)

    monkeypatch.setattr(threads, "Future", Preempted)
    element = Element()
    alive = weakref.ref(element)
    await in_thread(partial(isinstance, element, Element), 5)
    del element
    try:
        assert alive() is None
    finally:
        seen.set()
