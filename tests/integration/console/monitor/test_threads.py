"""What other threads hand to a window, and which thread ends what Qt owns."""

import gc
import threading
from collections.abc import Callable

import pytest
from PySide6.QtCore import QCoreApplication, QObject, Qt, QTimer
from PySide6.QtWidgets import QApplication

from common.errors import UserError
from console.client import Credentials
from console.monitor.credential_refresh import LoadCredentials
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.robots.robots_file import Robot, RobotsFile, robots_file_path
from console.robots.roster import RobotChoice, Roster
from console.window import programs
from console.window.background import BackgroundJob
from console.window.handover import ThreadHandover
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor, run_monitor
from tests.support.qt import let_pass, until

NO_LOGIN = Credentials()
OTHER = RobotChoice("lab2", "127.0.0.1:10", known=True)


def in_another_thread(act: Callable[[], object]) -> None:
    thread = threading.Thread(target=act)
    thread.start()
    thread.join()


def test_posts_of_other_threads_are_delivered_once_and_in_qts_thread() -> None:
    owner = QObject()
    handover, delivered = ThreadHandover(owner), list[int]()
    handover.delivered.connect(lambda: delivered.append(threading.get_ident()))
    for _ in range(3):
        in_another_thread(handover.post)
    until(lambda: delivered, "a delivery")
    assert delivered == [threading.get_ident()]


def test_after_its_end_a_hand_over_takes_nothing() -> None:
    owner = QObject()
    handover, delivered = ThreadHandover(owner), list[int]()
    handover.delivered.connect(lambda: delivered.append(1))
    handover.close()
    in_another_thread(handover.post)
    let_pass(0.1)
    assert not delivered


def test_everything_of_a_window_ends_in_qts_thread() -> None:
    """Also when the garbage collector runs in another thread, at any time after the window was closed."""
    ended_in: list[int] = []
    with monitor("127.0.0.1:9") as window:
        let_pass(0.2)
        objects = [window, window.video, *window.findChildren(ThreadHandover)]
        assert len(objects) >= 5
        for each in objects:
            each.destroyed.connect(
                lambda *_: ended_in.append(threading.get_ident()), Qt.ConnectionType.DirectConnection
            )
    expected = [threading.get_ident()] * len(objects)
    del window, objects, each
    in_another_thread(gc.collect)
    assert ended_in == expected


def test_jobs_run_one_at_a_time_and_report_in_qts_thread() -> None:
    owner = QObject()
    job, go_on, notes = BackgroundJob(owner), threading.Event(), list[tuple[int, Note]]()
    job.done.connect(lambda note: notes.append((threading.get_ident(), note)))
    note = Note("done", SeverityStyle.GOOD)

    def work() -> Note:
        go_on.wait(10)
        return note

    assert job.start(work)
    assert not job.start(work)
    go_on.set()
    until(lambda: notes, "the note")
    assert notes == [(threading.get_ident(), note)]
    assert job.start(work)
    until(lambda: len(notes) == 2, "the next one")


def shown() -> MonitorWindow | None:
    windows = (each for each in QApplication.topLevelWidgets() if isinstance(each, MonitorWindow))
    return next((each for each in windows if each.isVisible()), None)


@pytest.mark.parametrize("login_works", [True, False])
def test_another_robot_opens_in_a_window_of_its_own(
    application: QApplication, monkeypatch: pytest.MonkeyPatch, login_works: bool
) -> None:
    seen: list[tuple[str, str]] = []

    class Ours:
        def __enter__(self) -> QApplication:
            application.setQuitOnLastWindowClosed(True)
            return application

        def __exit__(self, *_error: object) -> None:
            application.setQuitOnLastWindowClosed(False)

    def login_of(choice: RobotChoice) -> LoadCredentials:
        assert choice == OTHER

        def load() -> Credentials:
            if not login_works:
                raise UserError("token: no such file", "Type: robotctl login lab2")
            return NO_LOGIN

        return load

    def act() -> None:
        if window := shown():
            notes = " ".join(note.text for note in window.toasts.notes)
            seen.append((window.header.target.text(), notes))
            if len(seen) == 1:
                window.header.name.fill()
                window.header.name.robots.actions()[0].trigger()
            else:
                window.close()

    monkeypatch.setattr(programs, "application", lambda _title: Ours())
    timer = QTimer(application, interval=300)
    timer.timeout.connect(act)
    timer.start()
    roster = Roster(lambda: RobotsFile(robots_file_path(), {"lab2": Robot(target=OTHER.target)}))
    run_monitor("127.0.0.1:9", roster=roster, login_of=login_of)
    timer.stop()
    QCoreApplication.processEvents()
    assert seen[0] == ("127.0.0.1:9", "")
    if login_works:
        assert seen[1] == (OTHER.target, "")
    else:
        assert seen[1] == ("127.0.0.1:9", "token: no such file. Type: robotctl login lab2")
