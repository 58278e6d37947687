"""`robotctl view` from its start to its end."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from console.monitor.renewed import Login
from console.monitor.video import overlay_of, pass_on
from console.monitor.worker import Worker, connecting
from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.account import Account, Bookkeeper
from console.viewer.session import VideoSession
from console.window.application import application
from console.window.video_view import VideoView
from console.window.view_window import ViewWindow

_HANG_UP_WITHIN_S = 0.8
"""Each of the two that work in threads of their own."""


@dataclass(frozen=True, slots=True)
class Viewing:
    """The window and all that works behind it."""

    window: ViewWindow
    session: VideoSession
    worker: Worker


def run_view(target: str, recording: Recording | None, login: Login | None = None) -> Account:
    """Shows the window until it is closed; returns what was seen.

    Raises:
        UserError: the target is no address, the login can't be used, or there is no display.
    """
    books = Bookkeeper()
    with application("Robot view") as app, viewing(target, recording, books, login) as now:
        app.exec()
    return books.account(now.session.figures().redials, recording)


@contextmanager
def viewing(
    target: str, recording: Recording | None, books: Bookkeeper, login: Login | None = None
) -> Iterator[Viewing]:
    """At the end of the block everything has hung up."""
    session = VideoSession(recording=recording)
    worker = Worker(target, lambda: pass_on(worker.newest(), session), connecting(login))
    video = VideoView(session, lambda: overlay_of(worker.newest()))

    def on_picture(frame: Frame) -> None:
        books.note(frame)
        video.make_ready(frame)

    session.watch_pictures(on_picture)
    window = ViewWindow(worker, session, video, recording)
    try:
        session.start()
        worker.start()
        window.show()
        yield Viewing(window, session, worker)
    finally:
        window.close()
        # Its shortcuts hold it, and it holds the last picture: only Qt can free it.
        window.deleteLater()
        worker.close(_HANG_UP_WITHIN_S)
        if session.close(_HANG_UP_WITHIN_S) and recording:
            # Only now does nobody write to it any more.
            recording.close()
