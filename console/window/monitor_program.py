"""`robotctl monitor` from its start to its end."""

from collections.abc import Iterator
from contextlib import contextmanager

from console.monitor.renewed import Login
from console.monitor.video import overlay_of, pass_on
from console.monitor.worker import Worker, connecting
from console.viewer.session import VideoSession
from console.window.application import application
from console.window.monitor_window import MonitorWindow
from console.window.news import News
from console.window.remembered import Remembered
from console.window.video_view import VideoView

_HANG_UP_WITHIN_S = 0.8
"""Each of the two that work in threads of their own: all is over in less than 2 s."""


def run_monitor(target: str, login: Login | None = None) -> None:
    """Shows the window until it is closed.

    Args:
        target: the robot's gateway.
        login: what proves to it who asks, as it is stored then.

    Raises:
        UserError: the target is no address, the login can't be used, or there is no display.
    """
    with application("Robot monitor") as app, monitor(target, login):
        app.exec()


@contextmanager
def monitor(target: str, login: Login | None = None) -> Iterator[MonitorWindow]:
    """The window and all that works behind it; at the end of the block everything has hung up."""
    news, session = News(), VideoSession()

    def on_news() -> None:
        pass_on(worker.newest(), session)
        news.tell()

    worker = Worker(target, on_news, connecting(login))
    video = VideoView(session, lambda: overlay_of(worker.newest()))
    window = MonitorWindow(worker, news, video, Remembered())
    try:
        session.start()
        worker.start()
        window.show()
        yield window
    finally:
        window.close()
        # Its shortcuts hold it, and it holds the last picture: only Qt can free it.
        window.deleteLater()
        worker.close(_HANG_UP_WITHIN_S)
        session.close(_HANG_UP_WITHIN_S)
