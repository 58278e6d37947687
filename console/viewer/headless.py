"""Views the video without a window: for scripts, and for recording on a machine without a screen."""

import threading
import time
from typing import Final

from common.errors import ExitCode, UserError
from console.client import PreviewState
from console.monitor.credential_refresh import LoadCredentials
from console.monitor.link import LinkState
from console.monitor.monitor_state import MonitorState
from console.receiver.delivery import DeliveryChoice
from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording
from console.viewer.playback import Playback, PlaybackState
from console.viewer.robot_video import RobotVideo
from console.viewer.summary import FrameCounter, ViewSummary

_POLL_S: Final = 0.1
_CLOSE_TIMEOUT_S: Final = 2.0


def watch_headless(
    target: str,
    *,
    frames: int | None,
    patience_s: float,
    recording: Recording | None,
    stop: threading.Event,
    load: LoadCredentials | None = None,
    delivery: DeliveryChoice = DeliveryChoice.AUTO,
) -> ViewSummary:
    """Receives frames until there are enough.

    Args:
        target: the robot's gateway.
        frames: how many are enough; None for all until `stop`.
        patience_s: longest time without a frame.
        recording: keeps the encoded stream, too; closed at the end.
        stop: ends it early.
        load: reads the stored credentials.
        delivery: how packets are delivered.

    Raises:
        GatewayError: the gateway was never reached.
        UserError: the preview is off, no frame came, this computer can't show the stream, or the recording
            failed.
    """
    counter = FrameCounter()
    robot = RobotVideo(target, load, pixels=PixelFormat.I420, recording=recording, delivery=delivery)
    robot.session.add_frame_listener(counter.count)
    robot.session.add_frame_listener(robot.meter.shown)

    def done() -> bool:
        return stop.is_set() or (frames is not None and counter.frames >= frames)

    try:
        robot.start()
        while not done():
            _check(robot.worker.latest(), robot.session.playback(), counter, patience_s)
            if recording and recording.error:
                raise recording.error
            with counter.changed:
                counter.changed.wait_for(done, _POLL_S)
    finally:
        robot.close(_CLOSE_TIMEOUT_S)
    summary = counter.summary(
        robot.session.redials, recording, robot.session.delivery(), robot.meter.summary()
    )
    if frames and summary.pictures < frames:
        raise UserError(f"ended after {summary.pictures} of {frames} frames")
    return summary


def _check(robot: MonitorState, playback: Playback, counter: FrameCounter, patience_s: float) -> None:
    """Raises the error that ends the viewing early, if there is one."""
    preview = robot.snapshot.status.preview if robot.snapshot else None
    if counter.frames == 0:
        if preview is None and robot.link.state is LinkState.LOST and robot.link.error:
            raise robot.link.error
        if preview and preview.state is PreviewState.DISABLED:
            raise UserError("the preview is off", "Type: robotctl preview on")
    if playback.state is PlaybackState.BLOCKED:
        raise UserError(playback.reason, playback.remedy)
    if time.monotonic() - counter.last_s <= patience_s:
        return
    if playback.state is PlaybackState.FAULTED:
        raise UserError(f"no frame for {patience_s:g} s: the preview is faulted: {playback.reason}")
    state = f"the preview is {preview.state.value}" if preview else "the gateway has not answered yet"
    reason = f"{state}; {playback.reason}" if playback.reason else state
    raise UserError(
        f"no frame for {patience_s:g} s: {reason}",
        "Look at: robotctl doctor",
        exit_code=ExitCode.UNREACHABLE,
    )
