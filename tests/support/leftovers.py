"""Each module of tests ends with what it began with, or fails: processes, threads, sockets, descriptors.

So does the whole run, because fixtures of the session end after the last module.

A process that outlives its parent can't be found among the children of the test's own process: what a test
starts carries a mark in its environment instead, and so does what that starts. When the process of the tests
is ended from outside, what bears its mark is ended after it (reaper.py).
"""

import gc
import logging
import os
import re
import socket
import sys
import threading
import time
import uuid
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import psutil
import pytest

from tests.support.reaper import start_reaper

_MARK: Final = "ROBOT_GATEWAY_TEST_RUN"
GONE_WITHIN_S = 10.0
_PORTS_OF_THE_PROCESS: Final = "@robot-gateway-ports-"
"""The claim of a process on its block of free ports, which it keeps (tests/support/free.py)."""
_TYPES_OF_FILES: Final = "mime.cache"
"""The system's list of types of files: Qt keeps it open from the first file dialog of a process on."""
_GONE: Final = "gone"
_UNNAMED: Final = "unnamed descriptor"
_MAY_STAY: Final = Counter({_UNNAMED: 16})
"""gRPC's pollers and the buses of GStreamer pipelines go when Python's collector or Qt gets to it. Tests
that leave one with each stream or connection are beyond this at the end of their module."""
_MAY_STAY_OF_ALL: Final = Counter({_UNNAMED: 1024})
"""What every module may leave adds up."""


def pytest_configure() -> None:
    """Marks this process, a worker of the run; nothing else has the same mark."""
    os.environ[_MARK] = uuid.uuid4().hex
    start_reaper(_MARK, os.environ[_MARK])


@pytest.fixture(autouse=True)
def no_log_of_a_test_that_has_ended() -> Iterator[None]:
    """Removes log handlers that a program has added in this process, and whose stream the test has closed.

    Without that, the next warning in any test raises, and prints what that test takes for its own output.
    """
    yield
    root = logging.getLogger()
    for handler in root.handlers[:]:
        if isinstance(handler, logging.StreamHandler) and getattr(handler.stream, "closed", False):
            root.removeHandler(handler)


@pytest.fixture(scope="session", autouse=True)
def nothing_left_of_the_session() -> Iterator[None]:
    """Fails the last test when a fixture of the session leaves something behind."""
    yield from _nothing_left(_MAY_STAY_OF_ALL)


@pytest.fixture(scope="module", autouse=True)
def nothing_left() -> Iterator[None]:
    """Fails the module's last test when the module leaves something behind."""
    yield from _nothing_left(_MAY_STAY)


def _nothing_left(may_stay: Counter[str]) -> Iterator[None]:
    before = _belongings()
    yield
    deadline_s = time.monotonic() + GONE_WITHIN_S
    while left := _belongings() - before - may_stay:
        if time.monotonic() > deadline_s:
            kinds = f"; all unnamed descriptors now: {_unnamed()}" if _UNNAMED in left else ""
            pytest.fail(f"left behind: {', '.join(sorted(left.elements()))}{kinds}", pytrace=False)
        _collect()
        time.sleep(0.02)


def _unnamed() -> str:
    """Which kinds there are, as the kernel names them."""
    kinds = Counter[str]()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # That of this very listing.
            path = entry.readlink()
            if not path.is_absolute():
                kinds[re.sub(r":\[\d+\]$", "", path.name)] += 1
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))


def _collect() -> None:
    # A program that ran in this process has frozen what there was.
    gc.unfreeze()
    gc.collect()
    # Windows that were closed are freed by Qt's event loop, which runs only in tests that want it to.
    if qt := sys.modules.get("PySide6.QtCore"):
        qt.QCoreApplication.sendPostedEvents(None, qt.QEvent.Type.DeferredDelete.value)


def _belongings() -> Counter[str]:
    """What there is now, by what it is."""
    return Counter((*_processes(), *_threads(), *_descriptors()))


def _processes() -> Iterator[str]:
    mark = f"{_MARK}={os.environ[_MARK]}".encode()
    statuses = {each.pid: _status(each) for each in psutil.Process().children(recursive=True)}
    for pid, status in statuses.items():
        if status == psutil.STATUS_ZOMBIE:
            yield f"process {pid} (it has ended and was not waited for)"
    # A child that was started this instant may still be in execve(2), where its environment reads as empty.
    children = {str(pid) for pid, status in statuses.items() if status not in {psutil.STATUS_ZOMBIE, _GONE}}
    for directory in Path("/proc").glob("[0-9]*"):
        if directory.name == str(os.getpid()):
            continue
        with suppress(OSError):  # It ended while we looked.
            if directory.name in children or mark in (directory / "environ").read_bytes().split(b"\0"):
                words = (directory / "cmdline").read_bytes().split(b"\0")
                yield f"process {directory.name} ({b' '.join(words).decode(errors='replace')})"


def _status(process: psutil.Process) -> str:
    with suppress(psutil.NoSuchProcess):
        return process.status()
    return _GONE


def _threads() -> Iterator[str]:
    # Python's own: pools of foreign libraries keep idle threads, GLib's under the name of their last task.
    for thread in threading.enumerate():
        # A foreign thread has an entry from its first log record on, which the collector of garbage can cause
        # in any of them; before Python 3.13 the entry outlives the thread.
        foreign = isinstance(thread, threading._DummyThread)
        # gRPC's asyncio side starts one with its first use in a process, and keeps it.
        if "_poll_wrapper" not in thread.name and not foreign:
            yield f"thread {thread.name}"


def _descriptors() -> Iterator[str]:
    sockets = {each.fd: each for each in psutil.Process().net_connections("all")}
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # That of this very listing.
            path, known = entry.readlink(), sockets.get(int(entry.name))
            if known and known.family in (socket.AF_INET, socket.AF_INET6):
                yield f"socket {known.type.name} {known.laddr} {known.raddr} {known.status}"
            elif known and known.laddr:
                # Unix sockets with an address: listeners, and what they have accepted.
                if not str(known.laddr).startswith(_PORTS_OF_THE_PROCESS):
                    yield f"socket {known.type.name} {known.laddr}"
            elif path.is_absolute():
                if path.name != _TYPES_OF_FILES:
                    yield f"file {path}"
            elif path.name.startswith("pipe:"):
                yield "pipe"
            elif not (path.name.startswith("socket:") and _belongs_to_fast_dds(int(entry.name))):
                yield _UNNAMED


def _belongs_to_fast_dds(descriptor: int) -> bool:
    """Whether it is a UDP socket without a port.

    A process with rclpy keeps one to its end for each address of the machine; each network of containers adds
    addresses.
    """
    with socket.socket(fileno=os.dup(descriptor)) as copy:
        return copy.type == socket.SOCK_DGRAM and copy.getsockname() == ("0.0.0.0", 0)  # noqa: S104  # not bound
