"""A viewer as a program: writes what it saw as JSON, `[captured_s, decoded_s, corrupt]` for each frame."""

import argparse
import json
import time
from contextlib import closing
from dataclasses import replace

from bench.video.viewing import capture_time
from bench.video.window import Glance
from console.client import GatewayClient
from console.receiver.frame import Frame, PixelFormat
from console.viewer.session import VideoSession


def main() -> None:
    """Watches with the console's session, which connects again when it must."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target", help="the robot's gateway")
    parser.add_argument("port", type=int, help="UDP port of the link to the stream")
    parser.add_argument("seconds", type=float)
    given = parser.parse_args()
    with GatewayClient(given.target) as client:
        status = client.status().preview
    assert status.endpoint
    seen: list[Glance] = []

    def note(frame: Frame) -> None:
        captured_s = capture_time(frame)
        if captured_s is not None:
            seen.append(Glance(captured_s, frame.arrival_s, frame.corrupt))

    session = VideoSession(pixels=PixelFormat.I420)
    session.add_frame_listener(note)
    with closing(session):
        session.start()
        session.follow(replace(status, endpoint=replace(status.endpoint, port=given.port)))
        time.sleep(given.seconds)
    print(json.dumps([(one.captured_s, one.decoded_s, one.corrupt) for one in seen]))


if __name__ == "__main__":
    main()
