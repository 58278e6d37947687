"""Fixtures that every test may use; each plugin says what it offers."""

import signal

pytest_plugins = [
    "tests.support.bounds",
    "tests.support.distribution",
    "tests.support.engine",
    "tests.support.leftovers",
    "tests.support.ros",
]


def pytest_configure() -> None:
    """A run in the background inherits ignored signals and would pass them on to the programs under test."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)
