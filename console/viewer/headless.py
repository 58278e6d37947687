"""Watching without a window: for scripts, and for recording on a machine without a screen."""

import threading
import time
from typing import Final

from common.errors import ExitCode, UserError
from console.client import PreviewState, PreviewStatus
from console.monitor.link import Phase as LinkPhase
from console.monitor.renewed import Login
from console.monitor.state import MonitorState
from console.monitor.video import pass_on
from console.monitor.worker import Worker, connecting
from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording
from console.viewer.account import Account, Bookkeeper
from console.viewer.session import VideoSession
from console.viewer.state import Phase, ViewState

_LOOK_S: Final = 0.1


def watch_headless(
    target: str,
    *,
    frames: int | None,
    patience_s: float,
    recording: Recording | None,
    stop: threading.Event,
    login: Login | None = None,
) -> Account:
    """Watches until there were enough pictures.

    Args:
        target: the robot's gateway.
        frames: how many pictures are enough; None: until `stop`.
        patience_s: how long no picture may come before it gives up.
        recording: keeps the encoded stream, too.
        stop: ends it early.
        login: what proves to the gateway who asks, as it is stored then.

    Raises:
        GatewayError: the gateway was not reached at all.
        UserError: the preview is off, no picture came, this computer can't show the stream, or the recording
            ended early.
    """
    books = Bookkeeper()
    session = VideoSession(pixels=PixelFormat.I420, on_picture=books.note, recording=recording)
    worker = Worker(target, lambda: pass_on(worker.newest(), session), connecting(login))
    try:
        session.start()
        worker.start()
        while not (stop.is_set() or _enough(books, frames)):
            _check(worker.newest(), session.state(), books, patience_s)
            if recording and recording.error:
                raise recording.error
            with books.news:
                books.news.wait_for(lambda: stop.is_set() or _enough(books, frames), _LOOK_S)
    finally:
        worker.close()
        if session.close() and recording:
            # Only now does nobody write to it any more.
            recording.close()
    account = books.account(session.figures().redials, recording)
    if frames and account.pictures < frames:
        raise UserError(f"ended after {account.pictures} of {frames} pictures")
    return account


def _enough(books: Bookkeeper, frames: int | None) -> bool:
    return frames is not None and books.pictures >= frames


def _check(robot: MonitorState, view: ViewState, books: Bookkeeper, patience_s: float) -> None:
    """Raises what ends the watching early."""
    if books.pictures == 0:
        if robot.snapshot is None and robot.link.phase is LinkPhase.LOST and robot.link.trouble:
            raise robot.link.trouble
        if robot.snapshot and robot.snapshot.status.preview.state is PreviewState.DISABLED:
            raise UserError("the preview is off", "Type: robotctl preview on")
    if view.phase is Phase.BLOCKED:
        raise UserError(view.reason, view.remedy)
    if time.monotonic() - books.last_s > patience_s:
        raise _no_picture(robot.snapshot.status.preview if robot.snapshot else None, view, patience_s)


def _no_picture(preview: PreviewStatus | None, view: ViewState, patience_s: float) -> UserError:
    if view.phase is Phase.FAULTED:
        return UserError(f"no picture for {patience_s:g} s: the preview is faulted: {view.reason}")
    state = f"the preview is {preview.state.value}" if preview else "the gateway has not answered yet"
    why = f"{state}; {view.reason}" if view.reason else state
    return UserError(
        f"no picture for {patience_s:g} s: {why}",
        "Look at: robotctl doctor",
        exit_code=ExitCode.UNREACHABLE,
    )
