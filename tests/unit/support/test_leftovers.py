"""What a module of tests leaves behind fails it."""

import os
import signal
from contextlib import suppress

import pytest

from tests.support.processes import has_ended
from tests.support.waiting import wait_until

pytest_plugins = ["pytester"]

LEAVES = {
    "process": ("process", "subprocess.Popen(['sleep', '5'], start_new_session=True)"),
    # A copy of the shell: an orphan in execve(2) is only noticed at the end of the session.
    "orphan": ("process", "subprocess.run(['sh', '-c', '(sleep 5; true) &'])"),
    "zombie": ("process", "KEPT.append(subprocess.Popen(['true']))"),
    "thread": ("thread", "threading.Thread(target=threading.Event().wait, args=(30,), daemon=True).start()"),
    "listener": ("socket", "KEPT.append(socket.create_server(('127.0.0.1', 0)))"),
    "connection": ("socket", "KEPT.extend(connected())"),
    "datagrams": ("socket", "KEPT.append(bound(socket.AF_INET, ('127.0.0.1', 0)))"),
    "unix_socket": ("socket", "KEPT.append(bound(socket.AF_UNIX, 'service.sock'))"),
    "file": ("file", "KEPT.append(open(__file__))"),
    "pipe": ("pipe", "KEPT.append(os.pipe())"),
    "events": ("unnamed descriptor", "KEPT.extend(os.eventfd(0) for _ in range(30))"),
}
"""Name of the module -> what is reported, what it does."""
TIDY = {
    "child": "subprocess.run(['true'])",
    # Of the process, and kept as long as it lives.
    "ports": "from tests.support.free import free_tcp_port; free_tcp_port()",
    # As a library's own thread does that logs something through Python, and ends.
    "foreign_thread": "_thread.start_new_thread(log_something, ()); assert LOGGED.wait(5)",
}
SHARED = """
@pytest.fixture(scope="session", autouse=True)
def shared():
    yield
    KEPT.append(socket.create_server(("127.0.0.1", 0)))
"""


def test_each_kind_of_leftover_fails_its_module(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # of the summary
    # The last one has the error of the session.
    ran = run(pytester, {name: body for name, (_, body) in LEAVES.items()} | {"zz_last": "pass"})
    ran.assert_outcomes(passed=len(LEAVES) + 1, errors=len(LEAVES) + 1)
    for name, (what, _) in LEAVES.items():
        ran.stdout.fnmatch_lines_random(f"ERROR test_{name}.py::test_it - *left behind: {what}*")


def test_a_fixture_of_the_session_that_leaves_something_fails(pytester: pytest.Pytester) -> None:
    ran = run(pytester, {"session": "pass"}, SHARED)
    ran.assert_outcomes(passed=1, errors=1)
    ran.stdout.fnmatch_lines("ERROR test_session.py::test_it - *left behind: socket*")


def test_modules_that_tidy_up_pass(pytester: pytest.Pytester) -> None:
    run(pytester, TIDY).assert_outcomes(passed=len(TIDY))


ENDED = """
import os, signal, subprocess
from pathlib import Path

def test_it():
    # As a program does that outlives its parent, too.
    subprocess.run(["sh", "-c", "sleep 600 & echo $! > pid"], check=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_process_has_started_that_was_killed_ends_after_it(pytester: pytest.Pytester) -> None:
    """The defect: servers of a test that hung ran on, as bounds.py ends its process without fixtures."""
    pytester.makepyfile(test_ended=ENDED)
    ran = pytester.runpytest_subprocess("-p", "tests.support.leftovers", "-p", "no:cacheprovider")
    assert ran.ret == -signal.SIGKILL
    pid = int((pytester.path / "pid").read_text(encoding="ascii"))
    try:
        wait_until(lambda: has_ended(pid), "it has ended", 60.0)
    finally:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def run(pytester: pytest.Pytester, bodies: dict[str, str], more: str = "") -> pytest.RunResult:
    """Runs a module of one test for each body."""
    pytester.makeconftest("from tests.support import leftovers; leftovers.GONE_WITHIN_S = 0.5")
    helpers = """
import _thread, logging, os, socket, subprocess, threading
import pytest
KEPT = []
LOGGED = threading.Event()

def log_something():
    logging.getLogger().error("something")
    LOGGED.set()

def bound(family, address):
    made = socket.socket(family, socket.SOCK_DGRAM)
    made.bind(address)
    return made

def connected():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return socket.create_connection(server.getsockname()), server.accept()[0]
"""
    modules = {
        f"test_{name}": f"{helpers}{more}\ndef test_it():\n    {body}\n" for name, body in bodies.items()
    }
    pytester.makepyfile(**modules)
    # In a process of its own: what is left behind ends with it, or by its own time.
    return pytester.runpytest_subprocess("-ra", "-p", "tests.support.leftovers", "-p", "no:cacheprovider")
