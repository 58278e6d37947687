"""Fixtures that every test may use; each plugin says what it offers."""

import os
import signal

from hypothesis import settings

pytest_plugins = [
    "tests.support.bounds",
    "tests.support.distribution",
    "tests.support.engine",
    "tests.support.leftovers",
    "tests.support.on_request",
    "tests.support.ros",
]


def pytest_configure() -> None:
    """Sets what holds for every test of the process."""
    # gRPC's handlers of a fork are for children that go on in Python. Where `subprocess` forks to change the
    # user, they have crashed one child in thirty before its exec, and have hung others (gRPC 1.85).
    os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
    # A run in the background inherits ignored signals and would pass them on to the programs under test.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)
    # How long an example takes depends on what else the machine does; pytest's timeout bounds each test.
    settings.register_profile("no deadline", deadline=None)
    settings.load_profile("no deadline")
