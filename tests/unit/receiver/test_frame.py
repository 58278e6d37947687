import dataclasses

import pytest

from tests.unit.receiver.frames import Memory, frame


def test_planes_have_whole_rows() -> None:
    whole = frame()
    assert whole.plane(0) == bytes(range(32))
    assert [len(whole.plane(index)) for index in range(3)] == [32, 8, 8]


def test_some_rows_of_luma_copy_no_more_than_that() -> None:
    whole = frame()
    assert whole.luma_rows(1, 2) == bytes(range(8, 24))
    assert isinstance(whole.pixels, Memory)
    assert whole.pixels.copied == 16


@pytest.mark.parametrize(("first", "count"), [(-1, 1), (4, 1), (3, 2), (0, -1)])
def test_rows_outside_the_frame(first: int, count: int) -> None:
    with pytest.raises(IndexError, match="of a frame with 4"):
        frame().luma_rows(first, count)


def test_a_frame_does_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        frame().width = 1  # type: ignore[misc]  # the point of the test
