"""A bound of a test fails it in a form that a stall may explain (tests/support/undisturbed.py)."""

import asyncio

import pytest

from tests.support.eventually import at_most
from tests.support.virtual_time import in_virtual_time


@in_virtual_time
async def test_what_takes_too_long_is_a_failed_assertion() -> None:
    with pytest.raises(AssertionError, match="not within 3 s: it ends"):
        async with at_most(3.0, "it ends"):
            await asyncio.sleep(4.0)
    assert asyncio.get_running_loop().time() == pytest.approx(3.0)


@in_virtual_time
async def test_what_ends_in_time_is_left_alone() -> None:
    async with at_most(3.0, "it ends"):
        await asyncio.sleep(2.0)


@in_virtual_time
async def test_a_time_out_of_the_block_itself_stays_one() -> None:
    with pytest.raises(TimeoutError):
        async with at_most(3.0, "it ends"):
            raise TimeoutError
