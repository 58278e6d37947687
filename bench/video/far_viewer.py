"""A viewer as a program, as `robotctl view --headless` watches: connects again, requests key frames, reports.

Writes what it saw as JSON: `frames`, `[captured_s, decoded_s, fingerprint]` of each frame, the first one null
where its stamp can't be read, and the final figures of the session.
"""

import argparse
import json
import time

from bench.video.viewing import capture_time
from console.presentation.json_form import json_form
from console.receiver.delivery import DeliveryChoice
from console.receiver.frame import Frame, PixelFormat
from console.viewer.robot_video import RobotVideo
from tests.support.whole_pictures import fingerprint

_CLOSE_TIMEOUT_S = 5.0


def main() -> None:
    """Watches for a while."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target", help="the robot's gateway")
    parser.add_argument("seconds", type=float)
    parser.add_argument("--delivery", type=DeliveryChoice, default=DeliveryChoice.AUTO)
    given = parser.parse_args()
    seen: list[tuple[float | None, float, int]] = []
    robot = RobotVideo(given.target, pixels=PixelFormat.I420, delivery=given.delivery)

    def note(frame: Frame) -> None:
        robot.meter.shown(frame)
        pixels = frame.read()
        seen.append((capture_time(frame, pixels), frame.arrival_s, fingerprint(frame, pixels)))

    robot.session.add_frame_listener(note)
    robot.start()
    try:
        time.sleep(given.seconds)
        delivery = robot.session.delivery()
    finally:
        robot.close(_CLOSE_TIMEOUT_S)
    found = {
        "frames": seen,
        "redials": robot.session.redials,
        "delivery": json_form(delivery),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
