from dataclasses import replace
from typing import Any

import pytest

from console.client.results import Detection, Detections
from console.viewer.geometry import Box
from console.viewer.overlay import marks

PICTURE = Box(0, 0, 640, 360)
DOG = Detection(
    class_id=16,
    class_name="dog",
    score=0.917,
    track_id="3",
    center_x_px=640,
    center_y_px=360,
    width_px=200,
    height_px=100,
)


def overlay(*items: Detection, **changes: Any) -> Detections:
    found = Detections(
        available=True,
        stale=False,
        age_ms=20,
        source_width_px=1280,
        source_height_px=720,
        count=len(items),
        items=items,
    )
    return replace(found, **changes)


def test_a_detection_is_drawn_around_its_centre_with_name_track_and_score() -> None:
    (mark,) = marks(overlay(DOG), PICTURE)
    assert mark.box == Box(270, 155, 100, 50)
    assert mark.label == "dog #3 92%"


def test_what_the_robot_does_not_name_is_numbered() -> None:
    (mark,) = marks(overlay(replace(DOG, class_name="", track_id="", score=float("nan"))), PICTURE)
    assert mark.label == "class 16"


@pytest.mark.parametrize(
    "changes",
    [{"stale": True}, {"available": False}, {"source_width_px": None}, {"source_height_px": 0}],
)
def test_boxes_that_may_be_wrong_are_not_drawn(changes: dict[str, Any]) -> None:
    assert marks(overlay(DOG, **changes), PICTURE) == []


def test_without_detections_nothing_is_drawn() -> None:
    assert marks(None, PICTURE) == []
    assert marks(overlay(), PICTURE) == []
