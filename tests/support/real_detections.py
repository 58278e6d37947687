"""A gateway's intake that reads messages of the real yolo_msgs: `python -m tests.support.real_detections`.

Publishes objects with masks and key points, as a detector does that segments and finds poses, and prints what
the board then holds, as JSON. With the stand-in of interfaces/ it fails: that has no such fields.
"""

import json
from dataclasses import asdict
from typing import Any, Final

from yolo_msgs.msg import Detection, DetectionArray, KeyPoint2D, Point2D

from gateway.config import SourceSettings
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import DETECTIONS
from tests.support.talker import talking
from tests.support.waiting import wait_until

_TOPIC: Final = "/yolo/detections"
_MOST: Final = 2
"""Of three objects so many are read."""
_MASK_POINTS: Final = 199
_KEY_POINTS: Final = 17


def main() -> None:
    board = Board()
    source = SourceSettings(
        kind="detections", topic=_TOPIC, type="yolo_msgs/msg/DetectionArray", max_items=_MOST
    )
    message = DetectionArray(detections=_objects())
    message.header.frame_id = "camera"
    with intake([source], board) as running, talking() as talker:
        talker.say(running, _TOPIC, message)
        found = wait_until(lambda: board[DETECTIONS], "detections")
    print(json.dumps(asdict(found.value)))


def _objects() -> list[Any]:
    person = Detection(class_id=0, class_name="person", score=0.875, id="7")
    person.bbox.center.position.x, person.bbox.center.position.y = 640.0, 360.0
    person.bbox.size.x, person.bbox.size.y = 100.0, 250.0
    car = Detection(class_id=2, class_name="car", score=0.5)
    car.bbox.center.position.x, car.bbox.center.position.y = 10.5, 20.25
    car.bbox.size.x, car.bbox.size.y = 30.0, 40.0
    dog = Detection(class_id=16, class_name="dog", score=0.25)
    for each in (person, car, dog):
        _add_what_the_gateway_does_not_read(each)
    return [person, car, dog]


def _add_what_the_gateway_does_not_read(detection: Any) -> None:
    detection.bbox.center.theta = 0.25
    detection.bbox3d.center.position.z, detection.bbox3d.frame_id = 4.0, "map"
    detection.mask.height, detection.mask.width = 720, 1280
    detection.mask.data = [Point2D(x=float(number), y=-1.0) for number in range(_MASK_POINTS)]
    detection.keypoints.data = [
        KeyPoint2D(id=number, point=Point2D(x=1.0, y=float(number)), score=0.5)
        for number in range(_KEY_POINTS)
    ]
    detection.keypoints3d.frame_id = "map"


if __name__ == "__main__":
    main()
