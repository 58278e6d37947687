"""A viewer as a program, of a stream without stamps: when its frames were captured, by its own reckoning.

Writes as JSON `captured_ns` of each whole frame, on the robot's monotonic clock, and `median_age_ms`.
"""

import argparse
import json
import threading
import time
from typing import Final

from bench.rows import MeasurementError
from console.receiver.frame import Frame, PixelFormat
from console.viewer.robot_video import RobotVideo

_BEGINS_WITHIN_S: Final = 20.0
_CLOSE_TIMEOUT_S: Final = 5.0


def main() -> None:
    """Watches for a while from the first frame on."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target", help="the robot's gateway")
    parser.add_argument("seconds", type=float)
    given = parser.parse_args()
    captured_ns: list[int] = []
    begun = threading.Event()
    robot = RobotVideo(given.target, pixels=PixelFormat.I420)

    def note(frame: Frame) -> None:
        robot.meter.shown(frame)
        if frame.capture_ns is not None and not frame.corrupt:
            captured_ns.append(frame.capture_ns)
            begun.set()

    robot.session.add_frame_listener(note)
    robot.start()
    try:
        if not begun.wait(_BEGINS_WITHIN_S):
            raise MeasurementError(f"no frame of known age within {_BEGINS_WITHIN_S:g} s")
        time.sleep(given.seconds)
        age = robot.meter.summary()
    finally:
        robot.close(_CLOSE_TIMEOUT_S)
    print(json.dumps({"captured_ns": captured_ns, "median_age_ms": age.median_ms if age else None}))


if __name__ == "__main__":
    main()
