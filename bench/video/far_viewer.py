"""A viewer as a program, as `robotctl view --headless` watches: connects again, requests key frames, reports.

Writes what it saw as JSON: `glances`, `[captured_s, decoded_s, corrupt]` of each frame, and the final figures
of the session.
"""

import argparse
import json
import time

from bench.video.viewing import capture_time
from bench.video.window import Glance
from console.presentation.json_form import json_form
from console.receiver.delivery import DeliveryChoice
from console.receiver.frame import Frame, PixelFormat
from console.viewer.robot_video import RobotVideo

_CLOSE_TIMEOUT_S = 5.0


def main() -> None:
    """Watches for a while."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target", help="the robot's gateway")
    parser.add_argument("seconds", type=float)
    parser.add_argument("--delivery", type=DeliveryChoice, default=DeliveryChoice.AUTO)
    given = parser.parse_args()
    seen: list[Glance] = []
    robot = RobotVideo(given.target, pixels=PixelFormat.I420, delivery=given.delivery)

    def note(frame: Frame) -> None:
        robot.meter.shown(frame)
        captured_s = capture_time(frame)
        if captured_s is not None:
            seen.append(Glance(captured_s, frame.arrival_s, frame.corrupt))

    robot.session.add_frame_listener(note)
    robot.start()
    try:
        time.sleep(given.seconds)
        delivery = robot.session.delivery()
    finally:
        robot.close(_CLOSE_TIMEOUT_S)
    found = {
        "glances": [(one.captured_s, one.decoded_s, one.corrupt) for one in seen],
        "redials": robot.session.redials,
        "delivery": json_form(delivery),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
