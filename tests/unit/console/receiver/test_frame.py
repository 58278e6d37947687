import dataclasses

import pytest

from tests.unit.console.receiver.frames import frame


def test_its_pixels_are_read_as_they_are() -> None:
    whole = frame()
    assert whole.read()[: whole.stride * whole.height] == bytes(range(32))
    assert len(whole.read()) == 48


def test_a_frame_does_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        frame().width = 1  # type: ignore[misc]  # the point of the test
